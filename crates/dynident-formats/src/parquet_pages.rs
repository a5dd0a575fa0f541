//! Pages of a Parquet column, refused where they are shorter than their own levels, or are coded by a dictionary that
//! the column has not: the reader takes both for granted.

use parquet::basic::Encoding;
use parquet::column::page::{Page, PageMetadata, PageReader};
use parquet::errors::{ParquetError, Result};
use parquet::schema::types::ColumnDescriptor;

/// Values of one page at most. Writers make pages of about 20,000; a page of repeated levels may claim 2^31 in a few
/// bytes.
const MOST_VALUES: u32 = 1 << 26;

/// The pages of `inner`, each looked at before it is handed on.
pub(crate) struct CheckedPages {
    inner: Box<dyn PageReader>,
    /// Highest repetition and definition level of the column.
    highest: [i16; 2],
    /// Whether a dictionary came before.
    has_dictionary: bool,
}

impl CheckedPages {
    pub(crate) fn new(inner: Box<dyn PageReader>, column: &ColumnDescriptor) -> Self {
        Self { inner, highest: [column.max_rep_level(), column.max_def_level()], has_dictionary: false }
    }

    /// Whether the page holds the levels that it says it does, and follows the dictionary that it needs.
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
        if page.num_values() > MOST_VALUES {
            return Err(ParquetError::General(format!("a page has more than {MOST_VALUES} values")));
        }
        let needs_dictionary = matches!(encoding, Encoding::PLAIN_DICTIONARY | Encoding::RLE_DICTIONARY);
        if !fits {
            Err(ParquetError::EOF("a page ends within its levels".into()))
        } else if needs_dictionary && !self.has_dictionary {
            Err(ParquetError::General("a page is coded by a dictionary that the column has not".into()))
        } else {
            Ok(())
        }
    }

    /// Repetition and then definition levels before the values of a page of the first version: packed bits (an encoding
    /// that is out of use) without a length, all others with one of their own, which the reader checks.
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
        // A dictionary that is passed over is kept by the reader until a page needs it.
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
