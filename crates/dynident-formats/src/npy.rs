//! NumPy: one array (`.npy`) or several of one length (`.npz`). Format:
//! <https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html>.

use crate::arrays::{Array, ArrayTable, EntryNames, MAX_COLUMNS};
use crate::bytes::{Bytes, Number};
use crate::error::FileError;
use crate::kind::FileFormat;
use crate::limits::{Budget, SPLIT_FIX};
use crate::table::Table;
use crate::zip;
use std::io::{BufReader, Read};
use std::path::Path;

const MAX_HEADER_BYTES: usize = 1 << 20;
/// Advice for the names of joints in an array with `dtype=object`.
const OBJECTS_FIX: &str = "; if they name the joints, save them as text: numpy.array(names, dtype=str)";
/// Names of arrays of texts that name the joints, and so the columns of the matrices.
const NAMES_OF_JOINTS: [&str; 5] = ["joint_names", "joint_name", "joints", "names", "motor_names"];

struct Header {
    /// Name (only in structured arrays), offset in an item, number of entries, and number type.
    fields: Vec<Field>,
    /// Length of an item, bytes.
    item: usize,
    fortran: bool,
    shape: Vec<usize>,
}

struct Field {
    name: Option<String>,
    offset: usize,
    number: Option<(Number, bool)>,
    text: Option<TextKind>,
    count: usize,
}

/// Encoding of fixed-width text.
#[derive(Clone, Copy)]
enum TextKind {
    Bytes,
    Utf32 { big_endian: bool },
}

/// Contents of one `.npy` stream.
enum Contents {
    Numbers(Vec<Array>),
    /// A vector of texts.
    Texts(Vec<String>),
    /// Python objects, which are never loaded.
    Objects,
}

pub(crate) fn open(path: &Path, mut reader: impl Read, mut budget: Budget) -> Result<Box<dyn Table>, FileError> {
    let Contents::Numbers(arrays) = contents(path, FileFormat::Npy, "", &mut reader, &mut budget)? else {
        return Err(nothing(path, FileFormat::Npy));
    };
    let named = arrays.iter().all(|array| !array.name.is_empty());
    let table = ArrayTable::new(arrays).ok_or_else(|| nothing(path, FileFormat::Npy))?;
    Ok(Box::new(if named { table } else { table.nameless() }))
}

pub(crate) fn open_archive(path: &Path, mut budget: Budget) -> Result<Box<dyn Table>, FileError> {
    let io = |source| FileError::Io { file: path.to_owned(), source };
    let mut file = dynident_files::open(path).map_err(io)?;
    let members = zip::members(path, &mut file)?;
    let (mut all, mut notes, mut found) = (Vec::new(), Vec::new(), 0);
    let mut joints = None;
    for member in &members {
        let Some(name) = member.name.strip_suffix(".npy") else { continue };
        found += 1;
        let mut member = BufReader::new(zip::contents(path, &mut file, member)?);
        let read = contents(path, FileFormat::Npz, name, &mut member, &mut budget);
        let is_of_joints = NAMES_OF_JOINTS.contains(&name);
        // The checksum is checked first, because a wrong one explains other errors. An array that is too large is not
        // read to its end.
        match read {
            Err(error @ FileError::Broken { fix: SPLIT_FIX, .. }) => return Err(error),
            read => {
                member.into_inner().verify(path)?;
                match read? {
                    Contents::Numbers(arrays) if !arrays.is_empty() => all.extend(arrays),
                    Contents::Texts(texts) if is_of_joints && joints.is_none() => {
                        joints = Some(EntryNames { array: name.to_owned(), names: texts });
                    }
                    Contents::Numbers(_) | Contents::Texts(_) => {
                        notes.push(format!("{name}: text, or more than two dimensions"));
                    }
                    Contents::Objects => {
                        let fix = if is_of_joints { OBJECTS_FIX } else { "" };
                        notes.push(format!("{name}: Python objects (pickle), which are never loaded{fix}"));
                    }
                }
            }
        }
    }
    if found == 0 {
        return Err(FileError::OtherFormat {
            file: path.to_owned(),
            format: "a ZIP archive without NumPy arrays (for example a workbook)",
            fix: "unpack the archive, or save the workbook's sheet as CSV",
        });
    }
    let table = ArrayTable::new(all).ok_or_else(|| nothing(path, FileFormat::Npz))?;
    let table = joints.into_iter().fold(table, ArrayTable::with_entry_names);
    Ok(Box::new(table.with_notes(notes)))
}

fn nothing(path: &Path, format: FileFormat) -> FileError {
    let found = "text, objects, complex numbers, or more than two dimensions";
    let fix = "save real columns with numpy.savez: `x.real` of complex numbers, `x.reshape(len(x), -1)` of an array with more dimensions, each array of a dict";
    FileError::no_columns(path, format, found, fix)
}

/// The contents of a `.npy` stream: its numeric arrays (one, or one for each field of a structured array), or a vector
/// of texts.
fn contents(
    path: &Path,
    format: FileFormat,
    name: &str,
    reader: &mut impl Read,
    budget: &mut Budget,
) -> Result<Contents, FileError> {
    let place = if name.is_empty() { "the array".to_owned() } else { format!("array `{name}`") };
    let broken =
        |problem: String| FileError::broken(path, format, place.clone(), problem, "write it again with numpy.save");
    let Some(header) = header(reader).map_err(&broken)? else { return Ok(Contents::Objects) };
    let items = header.shape.iter().try_fold(1_usize, |all, side| all.checked_mul(*side));
    let bytes = items.and_then(|items| items.checked_mul(header.item));
    let too_large = || FileError::broken(path, format, place.clone(), budget.problem(), SPLIT_FIX);
    let (Some(items), Some(bytes)) = (items, bytes.filter(|bytes| budget.allows(Some(*bytes as u64)))) else {
        return Err(too_large());
    };
    // Every number needs eight bytes in memory.
    let numbers = header.fields.iter().filter(|field| field.number.is_some()).map(|field| field.count);
    let numbers = numbers.sum::<usize>().checked_mul(items).and_then(|count| (count as u64).checked_mul(8));
    if !budget.allows(numbers) {
        return Err(too_large());
    }
    budget.take(numbers).map_err(&broken)?;
    if header.fields.iter().map(|field| field.count).sum::<usize>() > MAX_COLUMNS {
        return Err(broken(format!("it has more than {MAX_COLUMNS} columns")));
    }
    // Grow with the available bytes, not with the length in the header.
    let mut data = Vec::new();
    let read = reader.take(bytes as u64).read_to_end(&mut data);
    read.map_err(|error| broken(format!("it cannot be decompressed ({error})")))?;
    if data.len() < bytes {
        return Err(broken(format!("only {} of {bytes} bytes are present: the file is truncated", data.len())));
    }
    if let ([Field { name: None, text: Some(kind), .. }], [_]) = (&header.fields[..], &header.shape[..])
        && items <= MAX_COLUMNS
    {
        return Ok(Contents::Texts(data.chunks_exact(header.item).map(|item| kind.text(item)).collect()));
    }
    let mut arrays = Vec::new();
    for field in &header.fields {
        let Some((number, big_endian)) = field.number else { continue };
        let mut values = Vec::with_capacity(items * field.count);
        for item in data.chunks_exact(header.item) {
            let mut entries = Bytes::new(&item[field.offset..], big_endian);
            values.extend((0..field.count).map_while(|_| entries.number(number)));
        }
        let label = match (&field.name, name.is_empty()) {
            (Some(field), true) => field.clone(),
            (Some(field), false) => format!("{name}.{field}"),
            (None, _) => name.to_owned(),
        };
        let mut shape = header.shape.clone();
        if field.count > 1 {
            shape.push(field.count);
        }
        let Some([rows, columns]) = Array::two_sides(&shape) else { continue };
        // The entries of a field are contiguous in any order of the items, and a vector has only one order. The order
        // therefore matters only if an item is a single number.
        let column_major = header.fortran && field.count == 1;
        let make = if column_major { Array::column_major } else { Array::row_major };
        arrays.push(make(label, [rows, columns], values));
    }
    Ok(Contents::Numbers(arrays))
}

impl TextKind {
    /// The text of an item, which is padded with zeros.
    fn text(self, item: &[u8]) -> String {
        let text: String = match self {
            Self::Bytes => String::from_utf8_lossy(item).into_owned(),
            Self::Utf32 { big_endian } => {
                let mut codes = Bytes::new(item, big_endian);
                core::iter::from_fn(|| codes.u32())
                    .map(|code| char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER))
                    .collect()
            }
        };
        text.trim_end_matches('\0').to_owned()
    }
}

/// The header of an array; `None` if its entries are Python objects.
fn header(reader: &mut impl Read) -> Result<Option<Header>, String> {
    let cut = |_| "its header is truncated".to_owned();
    let mut begin = [0; 8];
    reader.read_exact(&mut begin).map_err(cut)?;
    if &begin[..6] != b"\x93NUMPY" {
        return Err("it does not start like a NumPy array".to_owned());
    }
    let mut length = [0; 4];
    let wide = begin[6] >= 2;
    reader.read_exact(&mut length[..if wide { 4 } else { 2 }]).map_err(cut)?;
    let length = u32::from_le_bytes(length) as usize;
    if length > MAX_HEADER_BYTES {
        return Err(format!("its header of {length} bytes is too long"));
    }
    let mut text = vec![0; length];
    reader.read_exact(&mut text).map_err(cut)?;
    let text = String::from_utf8_lossy(&text);
    let wrong = || "its header is invalid".to_owned();
    let mut literal = Literal { rest: text.trim() };
    let Value::Dict(entries) = literal.value(0).ok_or_else(wrong)? else { return Err(wrong()) };
    let entry = |key: &str| entries.iter().find(|(name, _)| name == key).map(|(_, value)| value);
    let shape = match entry("shape") {
        Some(Value::List(sides)) => sides.iter().map(|side| match side {
            Value::Number(side) => usize::try_from(*side).ok(),
            _ => None,
        }),
        _ => return Err(wrong()),
    };
    let shape = shape.collect::<Option<Vec<usize>>>().ok_or_else(wrong)?;
    let descr = entry("descr").ok_or_else(wrong)?;
    if has_objects(descr) {
        return Ok(None);
    }
    let (fields, item) = fields(descr).ok_or_else(wrong)?;
    Ok(Some(Header { fields, item, fortran: matches!(entry("fortran_order"), Some(Value::Word("True"))), shape }))
}

/// Whether an item contains a Python object: type `|O`.
fn has_objects(descr: &Value) -> bool {
    match descr {
        Value::Text(kind) => kind.contains('O'),
        Value::List(entries) => entries.iter().any(|entry| match entry {
            Value::List(parts) => parts.get(1).is_some_and(has_objects),
            _ => false,
        }),
        _ => false,
    }
}

/// Fields and length (bytes) of an item.
fn fields(descr: &Value) -> Option<(Vec<Field>, usize)> {
    match descr {
        Value::Text(kind) => {
            let (number, size) = scalar(kind)?;
            Some((vec![Field { name: None, offset: 0, number, text: text_kind(kind), count: 1 }], size))
        }
        Value::List(entries) => {
            let (mut fields, mut offset) = (Vec::new(), 0_usize);
            for entry in entries {
                let Value::List(parts) = entry else { return None };
                let (Some(Value::Text(name)), Some(Value::Text(kind))) = (parts.first(), parts.get(1)) else {
                    return None;
                };
                let (number, size) = scalar(kind)?;
                let sides = match parts.get(2) {
                    None => Vec::new(),
                    Some(Value::Number(side)) => vec![*side],
                    Some(Value::List(sides)) => sides
                        .iter()
                        .map(|side| if let Value::Number(side) = side { Some(*side) } else { None })
                        .collect::<Option<Vec<_>>>()?,
                    Some(_) => return None,
                };
                let count =
                    sides.iter().try_fold(1_usize, |all, side| all.checked_mul(usize::try_from(*side).ok()?))?;
                fields.push(Field { name: Some(name.clone()), offset, number, text: None, count });
                offset = offset.checked_add(size.checked_mul(count)?)?;
            }
            (offset > 0).then_some((fields, offset))
        }
        _ => None,
    }
}

/// Parses a type such as `<f8`: number type, whether it is big-endian, and length in bytes. The number type is `None`
/// for text and others.
fn scalar(kind: &str) -> Option<(Option<(Number, bool)>, usize)> {
    let (order, rest) = kind.split_at_checked(1)?;
    let (letter, size) = rest.split_at_checked(1)?;
    let size: usize = size.split('[').next()?.parse().ok()?;
    let number = match (letter, size) {
        ("f", 2) => Some(Number::F16),
        ("f", 4) => Some(Number::F32),
        ("f", 8) => Some(Number::F64),
        ("i", 1) => Some(Number::I8),
        ("i", 2) => Some(Number::I16),
        ("i", 4) => Some(Number::I32),
        ("i" | "m" | "M", 8) => Some(Number::I64),
        ("u" | "b", 1) => Some(Number::U8),
        ("u", 2) => Some(Number::U16),
        ("u", 4) => Some(Number::U32),
        ("u", 8) => Some(Number::U64),
        _ => None,
    };
    let bytes = if letter == "U" { size.checked_mul(4)? } else { size };
    (bytes > 0 && bytes <= 1 << 20).then_some((number.map(|number| (number, order == ">")), bytes))
}

/// The encoding of a text type such as `<U18` or `|S6`.
fn text_kind(kind: &str) -> Option<TextKind> {
    match (kind.get(..1)?, kind.get(1..2)?) {
        (order, "U") => Some(TextKind::Utf32 { big_endian: order == ">" }),
        (_, "S" | "a") => Some(TextKind::Bytes),
        _ => None,
    }
}

enum Value<'a> {
    Dict(Vec<(String, Value<'a>)>),
    List(Vec<Value<'a>>),
    Text(String),
    Number(i64),
    Word(&'a str),
}

struct Literal<'a> {
    rest: &'a str,
}

impl<'a> Literal<'a> {
    fn eat(&mut self, sign: char) -> bool {
        self.rest = self.rest.trim_start();
        let rest = self.rest.strip_prefix(sign);
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }

    fn value(&mut self, depth: usize) -> Option<Value<'a>> {
        if depth > 8 {
            return None;
        }
        if self.eat('{') {
            let mut entries = Vec::new();
            while !self.eat('}') {
                let Value::Text(key) = self.value(depth + 1)? else { return None };
                self.eat(':').then_some(())?;
                entries.push((key, self.value(depth + 1)?));
                self.eat(',');
            }
            return Some(Value::Dict(entries));
        }
        for (open, close) in [('(', ')'), ('[', ']')] {
            if self.eat(open) {
                let mut items = Vec::new();
                while !self.eat(close) {
                    items.push(self.value(depth + 1)?);
                    self.eat(',');
                }
                return Some(Value::List(items));
            }
        }
        for quote in ['\'', '"'] {
            if self.eat(quote) {
                let (text, rest) = self.rest.split_once(quote)?;
                self.rest = rest;
                return Some(Value::Text(text.to_owned()));
            }
        }
        let end = self.rest.find(|c: char| !c.is_alphanumeric() && c != '-' && c != '_').unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        match word {
            "" => None,
            word => Some(word.trim_end_matches('L').parse().map_or(Value::Word(word), Value::Number)),
        }
    }
}
