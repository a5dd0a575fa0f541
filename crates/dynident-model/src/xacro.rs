//! Detection of xacro macros and their arguments.

/// Whether a text contains xacro macros. A namespace declaration alone, which expanded files often keep, and comments
/// are ignored.
pub(crate) fn has_macros(text: &str) -> bool {
    if !text.contains("xmlns:xacro") {
        return false;
    }
    let mut rest = text;
    loop {
        let (before, comment) = rest.split_once("<!--").unwrap_or((rest, ""));
        if ["<xacro:", "${", "$("].iter().any(|sign| before.contains(sign)) {
            return true;
        }
        match comment.split_once("-->") {
            Some((_, after)) => rest = after,
            None => return false,
        }
    }
}

/// Names of the arguments (`<xacro:arg>`) that a file declares without a default value, in order. Declarations in
/// included files are not searched.
pub fn required_xacro_arguments(text: &str) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    let mut rest = text;
    while let Some(at) = rest.find("<xacro:arg") {
        let (before, tag) = rest.split_at(at);
        if let Some(comment) = before.find("<!--").filter(|comment| !before[*comment..].contains("-->")) {
            // The tag is inside a comment.
            rest = rest[comment..].split_once("-->").map_or("", |(_, after)| after);
            continue;
        }
        let (tag, after) = tag.split_once('>').unwrap_or((tag, ""));
        let value = |name: &str| {
            let (_, from) = tag.split_once(&format!(" {name}="))?;
            let quote = from.chars().next().filter(|quote| matches!(quote, '"' | '\''))?;
            from[1..].split_once(quote).map(|(value, _)| value.to_owned())
        };
        if let Some(name) = value("name").filter(|name| value("default").is_none() && !found.contains(name)) {
            found.push(name);
        }
        rest = after;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::{has_macros, required_xacro_arguments};

    #[test]
    fn arguments_without_default_are_listed_once() {
        let text = r#"<robot xmlns:xacro="x"><xacro:arg name="ur_type"/> <xacro:arg name="prefix" default=""/>
            <!-- <xacro:arg name="old"/> --><xacro:arg name='safety' /><xacro:arg name="ur_type"/><xacro:args/></robot>"#;
        assert_eq!(required_xacro_arguments(text), ["ur_type", "safety"]);
        for text in ["", "<xacro:arg", "<xacro:arg name=", "<!-- <xacro:arg name=\"a\"/>", "<xacro:arg name=\"a"] {
            assert!(required_xacro_arguments(text).is_empty(), "{text}");
        }
    }

    #[test]
    fn declarations_and_comments_are_no_macros() {
        let declared = r#"<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="r">"#;
        assert!(!has_macros(declared));
        assert!(has_macros(&format!("{declared}<xacro:property name=\"m\" value=\"2\"/>")));
        assert!(!has_macros(r#"<robot name="${r}"/>"#));
        assert!(!has_macros(&format!("{declared}<!-- ${{a}} --><link name=\"a\"/><!-- <xacro:b/> -->")));
        assert!(has_macros(&format!("{declared}<!-- a --><link name=\"${{a}}\"/>")));
        assert!(!has_macros(&format!("{declared}<!-- ${{a}}")));
    }
}
