//! MATLAB 4 files (`save -v4`, SciPy): matrices. Format: MathWorks, MAT-File Format (2023), appendix A.

use crate::arrays::{Array, ArrayTable};
use crate::bytes::{Bytes, Number};
use crate::error::FileError;
use crate::kind::FileFormat;
use crate::limits::{Budget, SPLIT_FIX};
use crate::table::Table;
use std::io::Read;
use std::path::Path;

const HEADER_BYTES: usize = 20;
const MAX_NAME_BYTES: u32 = 256;
const BLOCK_BYTES: usize = 1 << 16;

/// The header of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Header {
    big_endian: bool,
    number: Number,
    /// Type of the content: 0 for numbers, 1 for text, 2 for a sparse matrix.
    kind: u32,
    rows: u32,
    columns: u32,
    is_complex: bool,
    name_bytes: u32,
}

impl Header {
    fn parse(bytes: &[u8]) -> Option<Self> {
        let kind = Bytes::new(bytes.get(..4)?, false).u32()?;
        // The type consists of four decimal digits: byte order, zero, precision, content.
        let big_endian = kind > 9999;
        let mut words = Bytes::new(bytes.get(..HEADER_BYTES)?, big_endian);
        let kind = words.u32()?;
        let (rows, columns, imaginary, name_bytes) = (words.u32()?, words.u32()?, words.u32()?, words.u32()?);
        let number = match kind / 10 % 10 {
            0 => Number::F64,
            1 => Number::F32,
            2 => Number::I32,
            3 => Number::I16,
            4 => Number::U16,
            5 => Number::U8,
            _ => return None,
        };
        let is_valid = kind / 1000 == u32::from(big_endian)
            && kind / 100 % 10 == 0
            && kind % 10 <= 2
            && imaginary <= 1
            && (1..=MAX_NAME_BYTES).contains(&name_bytes);
        let (kind, is_complex) = (kind % 10, imaginary == 1);
        is_valid.then_some(Self { big_endian, number, kind, rows, columns, is_complex, name_bytes })
    }

    /// Length of the numbers, bytes.
    fn bytes(&self) -> Option<u64> {
        let parts = if self.is_complex { 2 } else { 1 };
        (u64::from(self.rows) * u64::from(self.columns)).checked_mul(parts * self.number.size() as u64)
    }
}

/// Whether a file with these first bytes is of this format. The format has no magic bytes, so the header must be
/// valid and be followed by a name that ends with NUL.
pub(crate) fn begins(head: &[u8]) -> bool {
    let Some(header) = Header::parse(head) else { return false };
    let name = head.get(HEADER_BYTES..HEADER_BYTES + header.name_bytes as usize);
    let letters = name.and_then(|name| name.strip_suffix(b"\0"));
    letters.is_some_and(|name| {
        name.first().is_some_and(u8::is_ascii_alphabetic)
            && name.iter().all(|byte| byte.is_ascii_alphanumeric() || *byte == b'_')
    })
}

pub(crate) fn open(path: &Path, mut reader: impl Read, mut budget: Budget) -> Result<Box<dyn Table>, FileError> {
    let broken = |variable: usize, problem: String, fix| {
        FileError::broken(path, FileFormat::Mat4, format!("variable {variable}"), problem, fix)
    };
    let truncated = |variable| broken(variable, "it is truncated".to_owned(), "save or copy it again");
    let io = |source| FileError::Io { file: path.to_owned(), source };
    let (mut arrays, mut others) = (Vec::new(), Vec::new());
    for variable in 0.. {
        let mut bytes = Vec::new();
        reader.by_ref().take(HEADER_BYTES as u64).read_to_end(&mut bytes).map_err(io)?;
        if bytes.is_empty() {
            break;
        }
        if bytes.len() < HEADER_BYTES {
            return Err(truncated(variable));
        }
        let header = Header::parse(&bytes)
            .ok_or_else(|| broken(variable, "its header is invalid".to_owned(), "save or copy it again"))?;
        let mut name = Vec::new();
        reader.by_ref().take(u64::from(header.name_bytes)).read_to_end(&mut name).map_err(io)?;
        let name = String::from_utf8_lossy(name.split(|byte| *byte == 0).next().unwrap_or_default()).into_owned();
        let size = header.bytes().ok_or_else(|| truncated(variable))?;
        if header.kind != 0 || header.is_complex {
            let passed = std::io::copy(&mut reader.by_ref().take(size), &mut std::io::sink()).map_err(io)?;
            if passed < size {
                return Err(truncated(variable));
            }
            others.push(format!("{name}: not real numbers"));
            continue;
        }
        let count = size / header.number.size() as u64;
        budget.take(count.checked_mul(8)).map_err(|problem| broken(variable, problem, SPLIT_FIX))?;
        let values = numbers(&mut reader, size, header).map_err(io)?.ok_or_else(|| truncated(variable))?;
        let shape = Array::two_sides(&[header.rows as usize, header.columns as usize]).unwrap_or_default();
        arrays.push(Array::column_major(name, shape, values));
    }
    let found = if others.is_empty() { "no variables".to_owned() } else { others.join(", ") };
    let table = ArrayTable::new(arrays).ok_or_else(|| {
        FileError::no_columns(path, FileFormat::Mat4, found, "save vectors or matrices of real numbers")
    })?;
    Ok(Box::new(table.with_notes(others)))
}

/// The numbers in the next `size` bytes; `None` if the file ends before.
fn numbers(reader: &mut impl Read, size: u64, header: Header) -> std::io::Result<Option<Vec<f64>>> {
    let (mut values, mut block, mut left) = (Vec::new(), Vec::new(), size);
    while left > 0 {
        block.clear();
        let part = left.min(BLOCK_BYTES as u64);
        reader.by_ref().take(part).read_to_end(&mut block)?;
        if (block.len() as u64) < part {
            return Ok(None);
        }
        let mut bytes = Bytes::new(&block, header.big_endian);
        values.extend((0..block.len() / header.number.size()).map_while(|_| bytes.number(header.number)));
        left -= part;
    }
    Ok(Some(values))
}
