//! A command as a person types it into a POSIX shell.

/// The words of a command, quoted so that a POSIX shell runs exactly this command: a copied line runs nothing else,
/// whatever the words contain.
pub(super) fn shell_words(words: &[String]) -> String {
    words.iter().map(|word| shell_word(word)).collect::<Vec<_>>().join(" ")
}

fn shell_word(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "/._-+=:,@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    // Within single quotes a shell expands nothing; a single quote itself ends them and is escaped outside.
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::shell_words;

    #[test]
    fn words_are_quoted_where_a_shell_would_expand_them() {
        let words = ["sh", "-c", "rm -r \"x\"", "", "it's", "$(id).urdf"].map(str::to_owned);
        assert_eq!(shell_words(&words), r#"sh -c 'rm -r "x"' '' 'it'\''s' '$(id).urdf'"#);
    }
}
