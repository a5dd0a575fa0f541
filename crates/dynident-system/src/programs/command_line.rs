//! Quoting of commands for a POSIX shell.

/// Quotes the words of a command so that a POSIX shell runs exactly this command, for any content of the words.
pub(super) fn shell_words(words: &[String]) -> String {
    words.iter().map(|word| shell_word(word)).collect::<Vec<_>>().join(" ")
}

fn shell_word(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "/._-+=:,@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    // A shell expands nothing within single quotes; a single quote in the word is escaped outside of them.
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
