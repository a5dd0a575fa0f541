//! MATLAB 5 files (`save -v6`, `-v7`, SciPy): numeric variables and fields of structs.
//! Format: MathWorks, MAT-File Format (2023), chapter 1.

use crate::error::FileError;
use crate::table::Table;
use std::io::BufRead;
use std::path::Path;

/// Description, for messages, of a variable that only MATLAB can read.
pub(crate) const OBJECT: &str = "a MATLAB object (table, timetable, string ..)";
/// How to save the numbers of such a variable.
pub(crate) const OBJECT_FIX: &str =
    "convert tables in MATLAB: `s = table2struct(T, \"ToScalar\", true); save(\"log.mat\", \"-struct\", \"s\")`";

#[cfg(not(feature = "gzip"))]
pub(crate) fn open(path: &Path, _: impl BufRead, _: crate::limits::Budget) -> Result<Box<dyn Table>, FileError> {
    Err(FileError::NotBuilt { file: path.to_owned(), format: "a MATLAB 5 file", feature: "gzip" })
}

#[cfg(feature = "gzip")]
pub(crate) use reading::open;

#[cfg(feature = "gzip")]
mod reading {
    use super::{BufRead, FileError, OBJECT, OBJECT_FIX, Path, Table};
    use crate::arrays::{Array, ArrayTable};
    use crate::bytes::{Bytes, Number};
    use crate::kind::FileFormat;
    use crate::limits::{Budget, SPLIT_FIX};
    use std::io::Read;

    const MAX_NESTING: usize = 8;
    /// Maximum length of a name, of the dimensions of an array, or of the list of a struct's fields, bytes.
    const MAX_HEAD_BYTES: usize = 1 << 20;
    const BLOCK_BYTES: usize = 1 << 16;

    const MATRIX: u32 = 14;
    const PACKED: u32 = 15;

    enum Problem {
        Cut,
        Misfit,
        TooLarge(String),
        Unreadable(std::io::Error),
    }

    impl From<std::io::Error> for Problem {
        fn from(error: std::io::Error) -> Self {
            if error.kind() == std::io::ErrorKind::UnexpectedEof { Self::Cut } else { Self::Unreadable(error) }
        }
    }

    impl Problem {
        fn at(self, path: &Path, variable: usize) -> FileError {
            let copy = "save or copy it again";
            let (problem, fix) = match self {
                Self::Cut => ("it is truncated".to_owned(), copy),
                Self::Misfit => ("its parts are inconsistent".to_owned(), copy),
                Self::TooLarge(problem) => (problem, SPLIT_FIX),
                Self::Unreadable(error) => (format!("it cannot be decompressed ({error})"), copy),
            };
            FileError::broken(path, FileFormat::Mat5, format!("variable {variable}"), problem, fix)
        }
    }

    struct Found {
        big_endian: bool,
        budget: Budget,
        arrays: Vec<Array>,
        others: Vec<String>,
    }

    pub(crate) fn open(path: &Path, mut reader: impl BufRead, budget: Budget) -> Result<Box<dyn Table>, FileError> {
        let mut header = [0; 128];
        let cut = "it is truncated";
        reader
            .read_exact(&mut header)
            .map_err(|_| FileError::broken(path, FileFormat::Mat5, "its header", cut, "save or copy it again"))?;
        let big_endian = &header[126..] == b"MI";
        let mut found = Found { big_endian, budget, arrays: Vec::new(), others: Vec::new() };
        let mut variable = 0;
        while found.variable(&mut reader).map_err(|problem| problem.at(path, variable))? {
            variable += 1;
        }
        let Found { arrays, others, .. } = found;
        let names = if others.is_empty() { "no variables".to_owned() } else { others.join(", ") };
        let table = ArrayTable::new(arrays).ok_or_else(|| {
            let fix = if names.contains(OBJECT) { OBJECT_FIX } else { "save vectors or matrices of real numbers" };
            FileError::no_columns(path, FileFormat::Mat5, names, fix)
        })?;
        Ok(Box::new(table.with_notes(others)))
    }

    fn number(kind: u32) -> Option<Number> {
        Some(match kind {
            1 => Number::I8,
            2 => Number::U8,
            3 => Number::I16,
            4 => Number::U16,
            5 => Number::I32,
            6 => Number::U32,
            7 => Number::F32,
            9 => Number::F64,
            12 => Number::I64,
            13 => Number::U64,
            _ => return None,
        })
    }

    struct Tag {
        kind: u32,
        size: usize,
        /// Content of an element of at most four bytes, which is stored in its tag.
        short: Option<[u8; 4]>,
    }

    /// Reads the rest of `reader`, so that the checksum of a compressed variable is verified.
    fn pass_over(reader: &mut dyn Read) -> Result<(), Problem> {
        std::io::copy(reader, &mut std::io::sink())?;
        Ok(())
    }

    impl Found {
        fn variable(&mut self, reader: &mut impl BufRead) -> Result<bool, Problem> {
            if reader.fill_buf()?.is_empty() {
                return Ok(false);
            }
            let mut tag = [0; 8];
            reader.read_exact(&mut tag)?;
            let mut words = Bytes::new(&tag, self.big_endian);
            let (kind, size) = words.u32().zip(words.u32()).ok_or(Problem::Cut)?;
            let mut body = reader.take(u64::from(size));
            match kind {
                PACKED => {
                    let mut unpacked = flate2::bufread::ZlibDecoder::new(&mut body);
                    let tag = self.tag(&mut unpacked)?;
                    if tag.kind == MATRIX {
                        self.matrix(&mut unpacked, tag.size, None, 0)?;
                    }
                    // The checksum follows the compressed data.
                    pass_over(&mut (&mut unpacked).take(8))?;
                }
                MATRIX => self.matrix(&mut body, size as usize, None, 0)?,
                _ => {}
            }
            pass_over(&mut body)?;
            if body.limit() > 0 { Err(Problem::Cut) } else { Ok(true) }
        }

        fn tag(&self, reader: &mut dyn Read) -> Result<Tag, Problem> {
            let mut tag = [0; 8];
            reader.read_exact(&mut tag)?;
            let mut words = Bytes::new(&tag, self.big_endian);
            let (word, size) = words.u32().zip(words.u32()).ok_or(Problem::Cut)?;
            // The short form stores up to four bytes in the tag.
            if word >> 16 == 0 {
                return Ok(Tag { kind: word, size: size as usize, short: None });
            }
            let short = [tag[4], tag[5], tag[6], tag[7]];
            let size = (word >> 16) as usize;
            if size > short.len() {
                return Err(Problem::Misfit);
            }
            Ok(Tag { kind: word & 0xFFFF, size, short: Some(short) })
        }

        /// Reads the padding to a multiple of eight bytes; it may be missing after the last element.
        fn padding(reader: &mut dyn Read, size: usize) -> Result<(), Problem> {
            pass_over(&mut reader.take((size.wrapping_neg() & 7) as u64))
        }

        /// The bytes of a short element: flags, dimensions, a name.
        fn head(&self, reader: &mut dyn Read) -> Result<Vec<u8>, Problem> {
            let tag = self.tag(reader)?;
            if let Some(short) = tag.short {
                return Ok(short[..tag.size].to_vec());
            }
            if tag.size > MAX_HEAD_BYTES {
                return Err(Problem::Misfit);
            }
            let mut bytes = vec![0; tag.size];
            reader.read_exact(&mut bytes)?;
            Self::padding(reader, tag.size)?;
            Ok(bytes)
        }

        fn numbers(&mut self, reader: &mut dyn Read, count: Option<usize>) -> Result<Vec<f64>, Problem> {
            let tag = self.tag(reader)?;
            let number = number(tag.kind).ok_or(Problem::Misfit)?;
            let count = count.filter(|count| count.checked_mul(number.size()) == Some(tag.size));
            let count = count.ok_or(Problem::Misfit)?;
            // Every number needs eight bytes in memory.
            self.budget.take((count as u64).checked_mul(8)).map_err(Problem::TooLarge)?;
            let mut values = Vec::new();
            let mut convert = |bytes: &[u8]| {
                let mut entries = Bytes::new(bytes, self.big_endian);
                values.extend((0..bytes.len() / number.size()).map_while(|_| entries.number(number)));
            };
            if let Some(short) = tag.short {
                convert(&short[..tag.size]);
                return Ok(values);
            }
            // Grow with the available bytes, not with the length in the tag.
            let (mut block, mut left) = (vec![0; BLOCK_BYTES.min(tag.size)], tag.size);
            while left > 0 {
                let part = &mut block[..left.min(BLOCK_BYTES)];
                reader.read_exact(part)?;
                convert(part);
                left -= part.len();
            }
            Self::padding(reader, tag.size)?;
            Ok(values)
        }

        /// Adds the arrays of a matrix element of `size` bytes: the array itself, or those of a struct's fields.
        /// `name` is the path of the variable or field.
        fn matrix(
            &mut self,
            reader: &mut dyn Read,
            size: usize,
            name: Option<String>,
            depth: usize,
        ) -> Result<(), Problem> {
            // An empty field of a struct has no content.
            if size == 0 {
                return Ok(());
            }
            let reader = &mut reader.take(size as u64);
            let flags = self.head(reader)?;
            let flags = Bytes::new(&flags, self.big_endian).u32().ok_or(Problem::Misfit)?;
            let (class, complex) = (flags & 0xFF, flags & 0x800 != 0);
            // An object has a name and no dimensions.
            if class == 17 {
                let own = self.head(reader)?;
                let name = name.unwrap_or_else(|| String::from_utf8_lossy(&own).into_owned());
                self.others.push(format!("{name}: {OBJECT}"));
                return pass_over(reader);
            }
            let sides = self.head(reader)?;
            let mut words = Bytes::new(&sides, self.big_endian);
            let mut sides = Vec::new();
            while let Some(side) = words.u32() {
                sides.push(side as usize);
            }
            let own = self.head(reader)?;
            let name = name.unwrap_or_else(|| String::from_utf8_lossy(&own).into_owned());
            match class {
                // double, single, and integers of any width
                6..=15 if !complex => {
                    let count = sides.iter().try_fold(1_usize, |all, side| all.checked_mul(*side));
                    let values = self.numbers(reader, count)?;
                    match Array::two_sides(&sides) {
                        // MATLAB stores the contents of objects in a variable without a name.
                        _ if name.is_empty() => {}
                        Some(shape) => self.arrays.push(Array::column_major(name, shape, values)),
                        None => self.others.push(format!("{name}: more than two dimensions")),
                    }
                }
                // struct
                2 if depth < MAX_NESTING && sides.iter().all(|side| *side == 1) => {
                    let length = self.head(reader)?;
                    let length = Bytes::new(&length, self.big_endian).u32().ok_or(Problem::Misfit)? as usize;
                    let names = self.head(reader)?;
                    if length == 0 || names.len() % length != 0 {
                        return Err(Problem::Misfit);
                    }
                    for field in names.chunks_exact(length) {
                        let field = field.split(|byte| *byte == 0).next().unwrap_or_default();
                        let path = format!("{name}.{}", String::from_utf8_lossy(field));
                        let tag = self.tag(reader)?;
                        if tag.short.is_some() {
                            return Err(Problem::Misfit);
                        }
                        self.matrix(reader, tag.size, Some(path), depth + 1)?;
                        Self::padding(reader, tag.size)?;
                    }
                }
                6..=15 => self.others.push(format!("{name}: complex numbers, save real(x) and imag(x)")),
                _ => self.others.push(format!("{name}: not real numbers")),
            }
            pass_over(reader)
        }
    }
}
