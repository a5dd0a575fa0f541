//! DIAdem data: a text header (`.dat`) and separate files of numbers. KUKA controllers write their traces in this
//! format, with a header for each drive. Keys of the header:
//! <https://www.ni.com/docs/en-US/bundle/diadem/page/header/header/header_overview.htm>.
//!
//! `value = number · (241) + (240)`. In a block, the numbers of all channels of a file are interleaved row by row;
//! `221` is the 1-based index of a channel's first number (0-based if it is 0 for any channel).

use crate::arrays::{Array, ArrayTable, MAX_COLUMNS};
use crate::bytes::{Bytes, Number};
use crate::error::FileError;
use crate::kind::FileFormat;
use crate::limits::{Budget, ReadLimits, SPLIT_FIX};
use crate::table::Table;
use std::collections::HashMap;
use std::io::Read;
use std::path::{Path, PathBuf};

pub(crate) const MAGIC: &[u8] = b"DIAEXTENDED";
const MAX_HEADER_BYTES: u64 = 1 << 24;
const COPY_FIX: &str = "copy the whole trace again, all files with its name";

struct Header {
    path: PathBuf,
    big_endian: bool,
    /// Number that marks missing values.
    missing: Option<f64>,
    channels: Vec<Channel>,
}

struct Channel(HashMap<u16, String>);

impl Channel {
    fn text(&self, key: u16) -> &str {
        self.0.get(&key).map_or("", String::as_str)
    }

    fn number(&self, key: u16) -> Option<f64> {
        self.text(key).parse().ok().filter(|number: &f64| number.is_finite())
    }

    fn whole(&self, key: u16) -> Option<usize> {
        self.text(key).parse().ok()
    }

    fn is_implicit(&self) -> bool {
        self.text(210).starts_with("IMPLI")
    }

    fn is_block(&self) -> bool {
        self.text(213) == "BLOCK"
    }

    /// Offset and factor of the values of a channel.
    fn scale(&self) -> [f64; 2] {
        [self.number(240).unwrap_or(0.0), self.number(241).unwrap_or(1.0)]
    }

    fn kind(&self) -> Option<Number> {
        Some(match self.text(214) {
            "REAL64" => Number::F64,
            "REAL32" => Number::F32,
            "INT32" => Number::I32,
            "INT16" => Number::I16,
            "WORD32" => Number::U32,
            "WORD16" => Number::U16,
            "WORD8" => Number::U8,
            _ => return None,
        })
    }

    fn name(&self) -> &str {
        self.text(200)
    }
}

fn broken(path: &Path, place: impl Into<String>, problem: impl Into<String>) -> FileError {
    FileError::broken(path, FileFormat::Diadem, place, problem, COPY_FIX)
}

impl Header {
    fn read(path: &Path) -> Result<Self, FileError> {
        let mut bytes = Vec::new();
        dynident_files::open(path)
            .and_then(|file| file.take(MAX_HEADER_BYTES).read_to_end(&mut bytes))
            .map_err(|source| FileError::Io { file: path.to_owned(), source })?;
        // Controllers write Latin-1, in which every byte is a valid character.
        let text = String::from_utf8(bytes)
            .unwrap_or_else(|error| error.into_bytes().into_iter().map(char::from).collect::<String>());
        let mut header = Self { path: path.to_owned(), big_endian: false, missing: None, channels: Vec::new() };
        let mut channel: Option<Channel> = None;
        for line in text.lines().map(str::trim) {
            match (line, line.split_once(',')) {
                ("#BEGINCHANNELHEADER", _) => channel = Some(Channel(HashMap::new())),
                ("#ENDCHANNELHEADER", _) => header.channels.extend(channel.take()),
                (_, Some((key, value))) => {
                    let (Ok(key), value) = (key.trim().parse(), value.trim()) else { continue };
                    match (&mut channel, key) {
                        (Some(channel), _) => {
                            channel.0.insert(key, value.to_owned());
                        }
                        (None, 111) => header.missing = value.parse().ok(),
                        (None, 112) => header.big_endian = value.starts_with("Low"),
                        (None, _) => {}
                    }
                }
                _ => {}
            }
        }
        if header.channels.is_empty() {
            return Err(broken(path, "its header", "it contains no complete channel"));
        }
        Ok(header)
    }

    /// The file with the numbers of a channel. The headers of a renamed trace contain the old file name; a file named
    /// like the header is then used.
    fn data(&self, channel: &Channel) -> Result<PathBuf, FileError> {
        let stated = channel.text(211).rsplit(['/', '\\']).next().unwrap_or_default();
        let kind = Path::new(stated).extension().unwrap_or_default().to_string_lossy().into_owned();
        let own = |kind: &str| self.path.with_extension(kind);
        let candidates =
            [self.path.with_file_name(stated), own(&kind), own(&kind.to_lowercase()), own(&kind.to_uppercase())];
        let found = candidates.into_iter().find(|path| !stated.is_empty() && path.is_file());
        let missing =
            || broken(&self.path, format!("channel `{}`", channel.name()), format!("file `{stated}` is missing"));
        found.ok_or_else(missing)
    }

    /// Start and step of the channel with evenly spaced times, and its length.
    fn clock(&self) -> Option<([f64; 2], Option<usize>)> {
        let channel = self.channels.iter().find(|channel| channel.is_implicit())?;
        Some((channel.scale(), channel.whole(220)))
    }
}

/// The header files of one trace: of all drives, `.._NextGenDrive#1.dat` etc., or only this one.
fn headers(path: &Path) -> Vec<PathBuf> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let kind = path.extension().unwrap_or_default().to_string_lossy().into_owned();
    let digits = |number: &str| !number.is_empty() && number.len() < 3 && number.bytes().all(|b| b.is_ascii_digit());
    let Some((trace, _)) = stem.rsplit_once('#').filter(|(_, number)| digits(number)) else {
        return vec![path.to_owned()];
    };
    let drive = |number: u32| path.with_file_name(format!("{trace}#{number}.{kind}"));
    let found: Vec<PathBuf> = (1..100).map(drive).filter(|path| path.is_file()).collect();
    if found.iter().any(|one| one == path) { found } else { vec![path.to_owned()] }
}

pub(crate) fn is_header(path: &Path) -> bool {
    let mut begin = [0; MAGIC.len()];
    let read = dynident_files::open(path).and_then(|mut file| file.read_exact(&mut begin));
    read.is_ok() && begin == MAGIC
}

/// The header files of the trace of `path`, each followed by its files of numbers.
pub(crate) fn files(path: &Path) -> Result<Vec<PathBuf>, FileError> {
    let mut files = Vec::new();
    for path in headers(path) {
        let header = Header::read(&path)?;
        files.push(path);
        for channel in header.channels.iter().filter(|channel| !channel.is_implicit()) {
            let data = header.data(channel)?;
            if !files.contains(&data) {
                files.push(data);
            }
        }
    }
    Ok(files)
}

pub(crate) fn open(path: &Path, limits: &ReadLimits) -> Result<Box<dyn Table>, FileError> {
    let paths = headers(path);
    let length = |path: &PathBuf| std::fs::metadata(path).map_or(0, |metadata| metadata.len());
    let mut budget =
        Budget::new(limits, files(path).unwrap_or_default().iter().map(length).fold(0, u64::saturating_add));
    let several = paths.len() > 1;
    let (mut arrays, mut notes) = (Vec::new(), Vec::new());
    let mut clock = None;
    for own in &paths {
        let header = Header::read(own)?;
        let theirs = header.clock();
        if *clock.get_or_insert(theirs) != theirs {
            let problem = "its time differs from that of the first drive";
            return Err(broken(own, "its header", problem));
        }
        // `[A3]` for drive 3.
        let number = own.file_stem().unwrap_or_default().to_string_lossy();
        let number = number.rsplit_once('#').map_or("", |(_, number)| number).to_owned();
        for channel in &header.channels {
            let is_time = channel.is_implicit();
            if is_time && own != &paths[0] {
                continue;
            }
            let name =
                if several && !is_time { format!("{}[A{number}]", channel.name()) } else { channel.name().to_owned() };
            let count = channel.whole(220);
            let count = count.ok_or_else(|| broken(own, format!("channel `{name}`"), "its length (220) is missing"))?;
            let place = || format!("channel `{name}`");
            if arrays.len() >= MAX_COLUMNS {
                return Err(broken(own, place(), format!("there are more than {MAX_COLUMNS} channels")));
            }
            budget
                .take((count as u64).checked_mul(8))
                .map_err(|problem| FileError::broken(own, FileFormat::Diadem, place(), problem, SPLIT_FIX))?;
            if !is_time && channel.kind().is_none() {
                notes.push(format!("{name}: numbers of type `{}` are not supported", channel.text(214)));
                continue;
            }
            let column = if is_time { Ok(even(channel, count)) } else { numbers(&header, channel, count) };
            arrays.push(Array::row_major(name, [count, 1], column?));
        }
    }
    let found = notes.join("; ");
    let table = ArrayTable::new(arrays).ok_or_else(|| {
        FileError::no_columns(path, FileFormat::Diadem, found, "record channels of binary numbers (REAL64)")
    })?;
    Ok(Box::new(table.with_notes(notes)))
}

fn even(channel: &Channel, count: usize) -> Vec<f64> {
    let [start, step] = channel.scale();
    (0..count).map(|row| start + step * row as f64).collect()
}

/// The values of a channel from its file.
fn numbers(header: &Header, channel: &Channel, count: usize) -> Result<Vec<f64>, FileError> {
    let broken = |problem: String| broken(&header.path, format!("channel `{}`", channel.name()), problem);
    let (Some(kind), path) = (channel.kind(), header.data(channel)?) else { return Ok(Vec::new()) };
    let beside: Vec<&Channel> = header
        .channels
        .iter()
        .filter(|other| !other.is_implicit() && other.text(211) == channel.text(211) && other.is_block())
        .collect();
    let stride = if channel.is_block() { beside.len() } else { 1 };
    // The format documents define key 222 as the step or as the length of a header, so other values than these are
    // ambiguous.
    if channel.is_block() && channel.whole(222).is_some_and(|step| step != 0 && step != stride) {
        return Err(broken(format!("222 is {}, but {stride} channels are interleaved", channel.text(222))));
    }
    if beside.iter().any(|other| channel.is_block() && other.kind() != Some(kind)) {
        return Err(broken("interleaved channels have different types".to_owned()));
    }
    let from_zero = header.channels.iter().any(|other| other.whole(221) == Some(0));
    let first = channel.whole(221).unwrap_or(1).saturating_sub(usize::from(!from_zero));
    let last =
        count.checked_sub(1).map_or(Some(0), |steps| steps.checked_mul(stride)?.checked_add(first)?.checked_add(1));
    let bytes = last.and_then(|last| last.checked_mul(kind.size()));
    let size = std::fs::metadata(&path).map_err(|source| FileError::Io { file: path.clone(), source })?.len();
    if bytes.is_none_or(|bytes| bytes as u64 > size) {
        let problem = format!("`{}` ends before {count} values", path.file_name().unwrap_or_default().display());
        return Err(broken(problem));
    }
    let data = dynident_files::read(&path, size).map_err(|source| FileError::Io { file: path.clone(), source })?;
    let [offset, factor] = channel.scale();
    let value = |row: usize| {
        let at = (first + row * stride) * kind.size();
        let number = Bytes::new(data.get(at..)?, header.big_endian).number(kind)?;
        (header.missing != Some(number)).then_some(number * factor + offset)
    };
    Ok((0..count).map(|row| value(row).unwrap_or(f64::NAN)).collect())
}
