//! Tables as LaTeX and Markdown.

use crate::error::ReportError;
use crate::table::Table;
use core::fmt::Write;
use dynident_text::{latex, markdown};

impl Table {
    /// The table as LaTeX: `tabular` with the rules of the package booktabs, title and note as a comment. Numeric
    /// columns are right-aligned.
    ///
    /// # Errors
    /// Rows of a wrong length.
    pub fn latex(&self) -> Result<String, ReportError> {
        self.check()?;
        let alignment: String = self.numeric().iter().map(|numeric| if *numeric { 'r' } else { 'l' }).collect();
        let line = |cells: &mut dyn Iterator<Item = &str>| cells.map(latex).collect::<Vec<_>>().join(" & ") + " \\\\\n";
        let mut text = self.remark("% ", "");
        let _ = writeln!(text, "% needs \\usepackage{{booktabs}}\n\\begin{{tabular}}{{{alignment}}}\n\\toprule");
        text += &line(&mut self.columns.iter().map(String::as_str));
        text += "\\midrule\n";
        for row in &self.rows {
            text += &line(&mut row.iter().map(|cell| cell.text.as_str()));
        }
        Ok(text + "\\bottomrule\n\\end{tabular}\n")
    }

    /// The table as Markdown, with its title and note above it.
    ///
    /// # Errors
    /// Rows of a wrong length.
    pub fn markdown(&self) -> Result<String, ReportError> {
        self.check()?;
        let line = |cells: &mut dyn Iterator<Item = &str>| {
            format!("| {} |\n", cells.map(markdown).collect::<Vec<_>>().join(" | "))
        };
        let mut text = self.remark("", "\n");
        text += &line(&mut self.columns.iter().map(String::as_str));
        let rules: Vec<&str> = self.numeric().iter().map(|numeric| if *numeric { "---:" } else { "---" }).collect();
        let _ = writeln!(text, "| {} |", rules.join(" | "));
        for row in &self.rows {
            text += &line(&mut row.iter().map(|cell| cell.text.as_str()));
        }
        Ok(text)
    }

    /// Title and note, one line each, which starts with `mark` and ends with `end`.
    fn remark(&self, mark: &str, end: &str) -> String {
        let lines = [&self.title, &self.note].into_iter().filter(|line| !line.is_empty());
        let shown =
            |line: &String| if mark.is_empty() { markdown(line) } else { dynident_text::one_line(line).into_owned() };
        lines.fold(String::new(), |mut text, line| {
            let _ = writeln!(text, "{mark}{}{end}", shown(line));
            text
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_keeps_its_rows_and_columns() {
        let table = Table::new("a\nb", ["joint_1", "± in %"]).note("n").row(["x & y | z", "1.5e-7"]).row(["#", "−2"]);
        let text = table.latex().unwrap();
        assert!(
            text.contains("\\begin{tabular}{lr}") && text.contains("joint\\_1 & \\ensuremath{\\pm} in \\% \\\\"),
            "{text}"
        );
        assert!(
            text.contains("x \\& y \\textbar{} z & 1.5e-7 \\\\\n\\# & \\ensuremath{-}2 \\\\\n\\bottomrule"),
            "{text}"
        );
        assert_eq!(text.lines().filter(|line| line.starts_with('%')).count(), 3);
        let text = table.markdown().unwrap();
        assert!(text.ends_with("| --- | ---: |\n| x &amp; y \\| z | 1.5e-7 |\n| # | −2 |\n"), "{text}");
        assert!(table.row(["one"]).latex().is_err());
    }
}
