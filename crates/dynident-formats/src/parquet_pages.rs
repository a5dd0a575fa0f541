//! Checks the pages of a Parquet column, because the Parquet library does not: a page must not be shorter than its
//! levels, and must not use a missing dictionary.

use parquet::basic::Encoding;
use parquet::column::page::{Page, PageMetadata, PageReader};
use parquet::errors::{ParquetError, Result};
use parquet::schema::types::ColumnDescriptor;

/// Maximum number of values of one page. Usual pages have about 20,000; a corrupt page of repeated levels may declare
/// 2^31 in a few bytes.
const MAX_PAGE_VALUES: u32 = 1 << 26;

pub(crate) struct CheckedPages {
    inner: Box<dyn PageReader>,
    /// Maximum repetition and definition level of the column.
    highest: [i16; 2],
    has_dictionary: bool,
}

impl CheckedPages {
    pub(crate) fn new(inner: Box<dyn PageReader>, column: &ColumnDescriptor) -> Self {
        Self { inner, highest: [column.max_rep_level(), column.max_def_level()], has_dictionary: false }
    }

    /// Checks the length of the levels and that the dictionary is present.
    fn check(&mut self, page: &Page) -> Result<()> {
        let (fits, encoding) = match page {
            Page::DataPage { buf, num_values, encoding, rep_level_encoding, def_level_encoding, .. } => {
                (self.levels_fit(buf, *num_values, [*rep_level_encoding, *def_level_encoding]), *encoding)
            }
            Page::DataPageV2 { buf, encoding, rep_levels_byte_len, def_levels_byte_len, .. } => {
                let levels = rep_levels_byte_len.checked_add(*def_levels_byte_len);
                (levels.is_some_and(|levels| levels as usize <= buf.len()), *encoding)
            }
            Page::DictionaryPage { .. } => {
                self.has_dictionary = true;
                return Ok(());
            }
        };
        if page.num_values() > MAX_PAGE_VALUES {
            return Err(ParquetError::General(format!("a page has more than {MAX_PAGE_VALUES} values")));
        }
        let needs_dictionary = matches!(encoding, Encoding::PLAIN_DICTIONARY | Encoding::RLE_DICTIONARY);
        if !fits {
            Err(ParquetError::EOF("a page ends inside its levels".into()))
        } else if needs_dictionary && !self.has_dictionary {
            Err(ParquetError::General("a page needs a dictionary that is missing in the column".into()))
        } else {
            Ok(())
        }
    }

    /// Whether the page contains its levels. The levels precede the values of a version 1 page, repetition levels
    /// first: packed bits (a deprecated encoding) without a length field, all others with one, which the reader checks.
    fn levels_fit(&self, page: &[u8], values: u32, encodings: [Encoding; 2]) -> bool {
        let mut rest = page;
        for (highest, encoding) in self.highest.into_iter().zip(encodings) {
            #[expect(deprecated, reason = "old files have it")]
            let packed = encoding == Encoding::BIT_PACKED;
            let length = match (highest, packed) {
                (..=0, _) => 0,
                (_, true) => {
                    let bits = u64::from(u16::BITS - highest.unsigned_abs().leading_zeros());
                    usize::try_from((u64::from(values) * bits).div_ceil(8)).unwrap_or(usize::MAX)
                }
                (_, false) => match rest.first_chunk() {
                    Some(length) => 4_usize.saturating_add(u32::from_le_bytes(*length) as usize),
                    None => return false,
                },
            };
            match rest.get(length..) {
                Some(after) => rest = after,
                None => return false,
            }
        }
        true
    }
}

impl Iterator for CheckedPages {
    type Item = Result<Page>;

    fn next(&mut self) -> Option<Self::Item> {
        self.get_next_page().transpose()
    }
}

impl PageReader for CheckedPages {
    fn get_next_page(&mut self) -> Result<Option<Page>> {
        let page = self.inner.get_next_page()?;
        if let Some(page) = &page {
            self.check(page)?;
        }
        Ok(page)
    }

    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>> {
        self.inner.peek_next_page()
    }

    fn skip_next_page(&mut self) -> Result<()> {
        // The library keeps a skipped dictionary until a page needs it.
        self.has_dictionary |= self.inner.peek_next_page()?.is_some_and(|page| page.is_dict);
        self.inner.skip_next_page()
    }

    fn supports_deferred_dictionary(&self) -> bool {
        self.inner.supports_deferred_dictionary()
    }

    fn take_deferred_dictionary(&mut self) -> Result<Option<Page>> {
        self.inner.take_deferred_dictionary()
    }

    fn at_record_boundary(&mut self) -> Result<bool> {
        self.inner.at_record_boundary()
    }
}
