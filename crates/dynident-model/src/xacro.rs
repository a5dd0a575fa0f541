//! Detection of xacro macros.

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

#[cfg(test)]
mod tests {
    use super::has_macros;

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
