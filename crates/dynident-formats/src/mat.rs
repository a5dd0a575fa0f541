//! MATLAB 5 files (`save -v6`, `-v7`, SciPy): numeric variables and fields of structs.
//! Format: MathWorks, MAT-File Format (2023), chapter 1.

use crate::error::FileError;
use crate::table::Table;
use std::io::BufRead;
use std::path::Path;

#[cfg(not(feature = "gzip"))]
pub(crate) fn open(path: &Path, _: impl BufRead) -> Result<Box<dyn Table>, FileError> {
    Err(FileError::NotBuilt { file: path.to_owned(), format: "a MATLAB 5 file", feature: "gzip" })
}

#[cfg(feature = "gzip")]
pub(crate) use reading::open;

#[cfg(feature = "gzip")]
mod reading {
    use super::{BufRead, FileError, Path, Table};
    use crate::arrays::{Array, ArrayTable};
    use crate::bytes::{Bytes, Number};
    use crate::kind::FileFormat;
    use std::io::Read;

    /// Unpacked bytes of all variables together, at most.
    const MOST_UNPACKED: u64 = 1 << 31;
    /// Structs in structs.
    const DEEPEST: usize = 8;

    const MATRIX: u32 = 14;
    const PACKED: u32 = 15;

    pub(crate) fn open(path: &Path, mut reader: impl BufRead) -> Result<Box<dyn Table>, FileError> {
        let broken = |place: String, problem: &str| {
            FileError::broken(path, FileFormat::Mat5, place, problem, "save or copy it again")
        };
        let mut header = [0; 128];
        reader.read_exact(&mut header).map_err(|_| broken("its header".to_owned(), "it is cut off"))?;
        let big_endian = &header[126..] == b"MI";
        let (mut arrays, mut others, mut left, mut variable) = (Vec::new(), Vec::new(), MOST_UNPACKED, 0);
        loop {
            let place = || format!("variable {variable}");
            let mut tag = Vec::new();
            let io = |source| FileError::Io { file: path.to_owned(), source };
            reader.by_ref().take(8).read_to_end(&mut tag).map_err(io)?;
            if tag.is_empty() {
                break;
            }
            let mut words = Bytes::new(&tag, big_endian);
            let (Some(kind), Some(size)) = (words.u32(), words.u32()) else {
                return Err(broken(place(), "it is cut off"));
            };
            let mut body = Vec::new();
            let read = reader.by_ref().take(u64::from(size).min(left + 1)).read_to_end(&mut body).map_err(io)?;
            if read as u64 > left {
                return Err(broken(place(), "more than 2 GiB of numbers"));
            }
            if read < size as usize {
                return Err(broken(place(), "it is cut off"));
            }
            if kind == PACKED {
                let mut unpacked = Vec::new();
                let mut decoder = flate2::read::ZlibDecoder::new(&body[..]).take(left + 1);
                let read = decoder.read_to_end(&mut unpacked);
                read.map_err(|error| broken(place(), &format!("it cannot be unpacked ({error})")))?;
                if unpacked.len() as u64 > left {
                    return Err(broken(place(), "more than 2 GiB of numbers"));
                }
                left -= unpacked.len() as u64;
                let mut element = Bytes::new(&unpacked, big_endian);
                match element.u32().zip(element.u32()) {
                    Some((MATRIX, size)) => {
                        let inside = element.take(size as usize).ok_or_else(|| broken(place(), "it is cut off"))?;
                        matrix(Bytes::new(inside, big_endian), big_endian, None, 0, &mut arrays, &mut others)
                            .ok_or_else(|| broken(place(), "its parts do not fit together"))?;
                    }
                    Some(_) => {}
                    None => return Err(broken(place(), "it is cut off")),
                }
            } else if kind == MATRIX {
                left -= body.len() as u64;
                matrix(Bytes::new(&body, big_endian), big_endian, None, 0, &mut arrays, &mut others)
                    .ok_or_else(|| broken(place(), "its parts do not fit together"))?;
            }
            variable += 1;
        }
        let found = if others.is_empty() { "no variables".to_owned() } else { others.join(", ") };
        let table = ArrayTable::new(arrays).ok_or_else(|| {
            let fix = "save vectors or matrices of real numbers (timetable: `save` its table2array)";
            FileError::no_columns(path, FileFormat::Mat5, found, fix)
        })?;
        Ok(Box::new(table.with_notes(others.into_iter().map(|name| format!("{name}: no real numbers")).collect())))
    }

    /// Kind and bytes of the next element, which begins at a multiple of eight.
    fn element<'a>(bytes: &mut Bytes<'a>) -> Option<(u32, &'a [u8])> {
        let word = bytes.u32()?;
        // The short form keeps up to four bytes in the tag.
        let (kind, body) = if word >> 16 != 0 {
            let body = bytes.take(4)?;
            (word & 0xFFFF, body.get(..(word >> 16) as usize)?)
        } else {
            let size = bytes.u32()? as usize;
            (word, bytes.take(size)?)
        };
        // The last element may lack its padding.
        let _ = bytes.align(8);
        Some((kind, body))
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

    /// Adds the arrays in a matrix element: its own, or those of a struct's fields. `name` is what a struct calls it.
    fn matrix(
        mut bytes: Bytes,
        big_endian: bool,
        name: Option<String>,
        depth: usize,
        arrays: &mut Vec<Array>,
        others: &mut Vec<String>,
    ) -> Option<()> {
        // An empty field of a struct has no parts at all.
        if bytes.left() == 0 {
            return Some(());
        }
        let (_, flags) = element(&mut bytes)?;
        let flags = Bytes::new(flags, big_endian).u32()?;
        let (class, complex) = (flags & 0xFF, flags & 0x800 != 0);
        let (_, sides) = element(&mut bytes)?;
        let mut words = Bytes::new(sides, big_endian);
        let mut sides = Vec::new();
        while let Some(side) = words.u32() {
            sides.push(side as usize);
        }
        let (_, own) = element(&mut bytes)?;
        let name = name.unwrap_or_else(|| String::from_utf8_lossy(own).into_owned());
        match class {
            // double, single, and integers of any width
            6..=15 if !complex => {
                let (kind, body) = element(&mut bytes)?;
                let number = number(kind)?;
                let count = sides.iter().try_fold(1_usize, |all, side| all.checked_mul(*side))?;
                if body.len() != count.checked_mul(number.size())? {
                    return None;
                }
                let mut entries = Bytes::new(body, big_endian);
                let values: Vec<f64> = (0..count).map_while(|_| entries.number(number)).collect();
                match Array::two_sides(&sides) {
                    Some(shape) => arrays.push(Array::column_major(name, shape, values)),
                    None => others.push(name),
                }
            }
            // struct
            2 if depth < DEEPEST && sides.iter().all(|side| *side == 1) => {
                let (_, length) = element(&mut bytes)?;
                let length = Bytes::new(length, big_endian).u32()? as usize;
                let (_, names) = element(&mut bytes)?;
                if length == 0 || names.len() % length != 0 {
                    return None;
                }
                for field in names.chunks_exact(length) {
                    let field = field.split(|byte| *byte == 0).next().unwrap_or_default();
                    let (_, body) = element(&mut bytes)?;
                    let path = format!("{name}.{}", String::from_utf8_lossy(field));
                    matrix(Bytes::new(body, big_endian), big_endian, Some(path), depth + 1, arrays, others)?;
                }
            }
            _ => others.push(name),
        }
        Some(())
    }
}
