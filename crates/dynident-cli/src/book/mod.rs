//! The documentation pages that are part of the program: their list, a page by name or title, a search, and the
//! explanation of a message's code.

mod markdown;

pub(crate) use markdown::{inline, rendered};

use crate::packed;

/// Name of the page with the codes of messages.
const MESSAGES: &str = "messages";

/// Smallest Jaro-Winkler similarity of a proposed name. Names with one wrong letter have 0.9 or more.
const MIN_SIMILARITY: f64 = 0.75;

/// Largest number of proposed names.
const MAX_PROPOSED: usize = 4;

/// A page of the documentation.
pub(crate) struct Page {
    /// Name of the file without `.md`.
    pub(crate) name: String,
    /// Markdown of the page.
    pub(crate) text: String,
}

/// An entry of the page "Messages".
pub(crate) struct Entry<'a> {
    pub(crate) code: &'a str,
    pub(crate) message: &'a str,
    /// Cause and fix.
    pub(crate) reason: &'a str,
    /// Heading of its section, and the text of the section before the table.
    pub(crate) section: &'a str,
    pub(crate) introduction: &'a str,
}

/// Text that a program without all pages appends to a sentence.
pub(crate) const SMALL_NOTE: &str = if cfg!(feature = "book") {
    ""
} else {
    concat!("; this package contains only the pages about messages; all pages: ", env!("CARGO_PKG_REPOSITORY"))
};

/// All pages, in the order of the documentation.
pub(crate) fn pages() -> Result<Vec<Page>, String> {
    let files = packed::files(include_bytes!(concat!(env!("OUT_DIR"), "/book.deflate")))?;
    Ok(files.into_iter().map(|file| Page { name: file.name, text: file.text }).collect())
}

impl Page {
    pub(crate) fn title(&self) -> String {
        inline(self.text.lines().find_map(|line| line.strip_prefix("# ")).unwrap_or(&self.name))
    }

    /// First sentence of the page.
    pub(crate) fn about(&self) -> String {
        let first = self.text.lines().find(|line| line.starts_with(char::is_alphabetic)).unwrap_or_default();
        let first = inline(first);
        first.find(". ").map_or(first.clone(), |end| first[..=end].to_owned())
    }

    /// Headings of the sections that contain all words, ignoring case; empty if only the page as a whole contains
    /// them, and `None` if it does not.
    pub(crate) fn matches(&self, words: &[String]) -> Option<Vec<String>> {
        let has_all = |text: &str| {
            let text = text.to_lowercase();
            words.iter().all(|word| text.contains(&word.to_lowercase()))
        };
        let sections = sections(&self.text);
        let found = sections.filter(|(heading, text)| !heading.is_empty() && (has_all(heading) || has_all(text)));
        let found: Vec<String> = found.map(|(heading, _)| inline(heading)).collect();
        (!found.is_empty() || has_all(&self.text)).then_some(found)
    }
}

/// Headings below the title with their text; the first one is empty. Lines of code that begin with `#` are text.
fn sections(text: &str) -> impl Iterator<Item = (&str, &str)> {
    let (mut starts, mut is_code, mut at) = (vec![(0, "")], false, 0);
    for line in text.split_inclusive('\n') {
        is_code ^= line.trim_start().starts_with("```");
        if !is_code && line.starts_with("##") {
            starts.push((at, line.trim_start_matches('#').trim()));
        }
        at += line.len();
    }
    let ends: Vec<usize> = starts.iter().skip(1).map(|(at, _)| *at).chain([text.len()]).collect();
    starts.into_iter().zip(ends).map(|((start, heading), end)| (heading, &text[start..end]))
}

/// Finds a page by its name, its title, or a part of one of them that no other page has.
///
/// # Errors
/// A message with the pages that contain `wanted`, or with the nearest names.
pub(crate) fn page<'a>(pages: &'a [Page], wanted: &str) -> Result<&'a Page, String> {
    let plain = |name: &str| name.to_lowercase().replace('`', "");
    let wanted = plain(wanted);
    let names = |page: &Page| [page.name.clone(), plain(&page.title())];
    if let Some(exact) = pages.iter().find(|page| names(page).contains(&wanted)) {
        return Ok(exact);
    }
    let parts: Vec<&Page> = pages.iter().filter(|page| names(page).iter().any(|name| name.contains(&wanted))).collect();
    let list = |pages: &[&Page]| pages.iter().map(|page| &page.name[..]).collect::<Vec<_>>().join(", ");
    match &parts[..] {
        [one] => return Ok(one),
        [] => {}
        several => return Err(format!("several pages match `{wanted}`: give one of {}", list(several))),
    }
    let similarity =
        |page: &Page| names(page).iter().map(|name| strsim::jaro_winkler(name, &wanted)).fold(0.0, f64::max);
    let mut near: Vec<&Page> = pages.iter().filter(|page| similarity(page) >= MIN_SIMILARITY).collect();
    near.sort_by(|a, b| similarity(b).total_cmp(&similarity(a)));
    near.truncate(MAX_PROPOSED);
    let near = if near.is_empty() { String::new() } else { format!("; similar names: {}", list(&near)) };
    Err(format!(
        "unknown page or code `{wanted}`{near}; `dynident docs` lists the pages, `dynident docs --search WORDS` searches them{SMALL_NOTE}"
    ))
}

/// Finds the entry of the page "Messages" for the code of a message.
pub(crate) fn entry<'a>(pages: &'a [Page], code: &str) -> Option<Entry<'a>> {
    let page = pages.iter().find(|page| page.name == MESSAGES)?;
    let start = format!("| `{}` |", code.to_lowercase());
    sections(&page.text).find_map(|(section, text)| {
        let row = text.lines().find(|line| line.starts_with(&start))?;
        let cells = markdown::cells(row);
        let [code, message, reason] = cells[..] else { return None };
        let introduction = text.split_once('\n')?.1.split("\n|").next()?.trim();
        Some(Entry { code: code.trim_matches('`'), message, reason, section, introduction })
    })
}
