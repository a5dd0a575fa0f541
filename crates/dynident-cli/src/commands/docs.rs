//! `dynident docs [PAGE]`.

use super::{Context, json};
use crate::book::{self, Entry, Page};
use crate::{Verdict, terminal};
use core::fmt::Write;
use serde::Serialize;

/// Name and version of the schema of `docs --json`.
pub const DOCS_SCHEMA: &str = "dynident/docs/1";

#[derive(clap::Args)]
pub(crate) struct Options {
    /// Name or title of a page, a part of it, or the code of a message. Without it, all pages are listed.
    page: Option<String>,
    /// List the pages and headings that contain all words.
    #[arg(long, value_name = "WORDS", num_args = 1.., conflicts_with = "page")]
    search: Vec<String>,
}

/// Output of `docs --json`: pages of the documentation.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DocsFile {
    /// Name and version of the schema: [`DOCS_SCHEMA`].
    pub schema: String,
    /// Version of the program.
    pub version: String,
    /// All pages, the page that was requested, or the pages that contain the words.
    pub pages: Vec<DocsPage>,
    /// The message whose code was requested; null otherwise.
    pub message: Option<DocsMessage>,
}

/// A page of the documentation.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DocsPage {
    /// Name of the page in `dynident docs NAME`.
    pub name: String,
    /// Title of the page.
    pub title: String,
    /// First sentence of the page.
    pub about: String,
    /// Headings of the sections that contain the words of a search; empty otherwise.
    pub headings: Vec<String>,
    /// Markdown of a requested page; null in lists.
    pub text: Option<String>,
}

/// A message of the program.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DocsMessage {
    /// Code of the message.
    pub code: String,
    /// The message, with placeholders in braces.
    pub message: String,
    /// Cause and fix.
    pub reason: String,
    /// Heading of its section on the page "Messages".
    pub section: String,
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    let pages = book::pages()?;
    if !options.search.is_empty() {
        // Words in quotation marks are searched as separate words, too.
        let words: Vec<String> =
            options.search.iter().flat_map(|words| words.split_whitespace()).map(str::to_owned).collect();
        return search(&pages, &words, context);
    }
    let Some(wanted) = &options.page else { return list(&pages, context) };
    if let Some(entry) = book::entry(&pages, wanted) {
        return explain(&entry, context);
    }
    let page = book::page(&pages, wanted)?;
    if context.json {
        return print_json(vec![DocsPage { text: Some(page.text.clone()), ..summary(page) }], None);
    }
    print(&book::rendered(&page.text, terminal::width(), terminal::is_styled()))
}

fn summary(page: &Page) -> DocsPage {
    DocsPage { name: page.name.clone(), title: page.title(), about: page.about(), headings: Vec::new(), text: None }
}

fn list(pages: &[Page], context: &Context) -> Result<Verdict, String> {
    if context.json {
        return print_json(pages.iter().map(summary).collect(), None);
    }
    let name_columns = pages.iter().map(|page| page.name.len()).max().unwrap_or_default();
    let mut text = String::new();
    for page in pages {
        let line = format!("{:name_columns$}  {}: {}", page.name, page.title(), page.about());
        let _ = writeln!(text, "{}", cut(&line, terminal::width()));
    }
    text += "\ndynident docs PAGE prints a page\ndynident docs CODE explains a message";
    let _ = writeln!(text, "\ndynident docs --search WORDS lists the pages with these words{}", book::SMALL_NOTE);
    print(&text)
}

/// A line of at most `columns` columns.
fn cut(line: &str, columns: usize) -> String {
    if line.chars().count() <= columns {
        return line.to_owned();
    }
    line.chars().take(columns.saturating_sub(2)).collect::<String>() + ".."
}

fn search(pages: &[Page], words: &[String], context: &Context) -> Result<Verdict, String> {
    let found = pages.iter().filter_map(|page| Some(DocsPage { headings: page.matches(words)?, ..summary(page) }));
    let found: Vec<DocsPage> = found.collect();
    if context.json {
        return print_json(found, None);
    }
    let mut text = String::new();
    for page in &found {
        let _ = writeln!(text, "{}: {}", page.name, page.title);
        for heading in &page.headings {
            let _ = writeln!(text, "  {heading}");
        }
    }
    if found.is_empty() {
        let _ = writeln!(text, "no page contains all of these words: {}", words.join(" "));
    }
    print(&text)
}

fn explain(entry: &Entry<'_>, context: &Context) -> Result<Verdict, String> {
    let [message, reason] = [entry.message, entry.reason].map(book::inline);
    // A message is formatted as code in the table; without its backquotes it reads as it is printed.
    let code = message.strip_prefix('`').and_then(|text| text.strip_suffix('`')).filter(|text| !text.contains('`'));
    let message = code.unwrap_or(&message).to_owned();
    if context.json {
        let (code, section) = (entry.code.to_owned(), book::inline(entry.section));
        return print_json(Vec::new(), Some(DocsMessage { code, message, reason, section }));
    }
    let mut body = format!("message: {message}\n\n");
    if !reason.is_empty() {
        let _ = write!(body, "cause and fix: {reason}\n\n");
    }
    let page = format!("# {}\n\n{body}{}\n", entry.code, entry.introduction);
    print(&book::rendered(&page, terminal::width(), terminal::is_styled()))
}

fn print(text: &str) -> Result<Verdict, String> {
    terminal::print_own(text.as_bytes())?;
    Ok(Verdict::Good)
}

fn print_json(pages: Vec<DocsPage>, message: Option<DocsMessage>) -> Result<Verdict, String> {
    let version = env!("CARGO_PKG_VERSION").to_owned();
    terminal::print_document(&json(&DocsFile { schema: DOCS_SCHEMA.to_owned(), version, pages, message })?)?;
    Ok(Verdict::Good)
}
