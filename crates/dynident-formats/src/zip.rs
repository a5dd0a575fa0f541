//! Reads ZIP archives written by NumPy: stored or deflated members, including ZIP64.

use crate::bytes::Bytes;
use crate::error::FileError;
use crate::kind::FileFormat;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

#[derive(Clone, Debug)]
pub(crate) struct Member {
    pub(crate) name: String,
    method: u16,
    /// CRC-32 of the decompressed bytes.
    crc: u32,
    packed: u64,
    header: u64,
}

/// Maximum length of the end record with its comment, bytes.
const MAX_END_BYTES: u64 = 22 + 65535;
const MAX_LIST_BYTES: u64 = 1 << 26;

fn broken(path: &Path, place: &str, problem: &str) -> FileError {
    FileError::broken(path, FileFormat::Npz, place, problem, "copy or write it again")
}

pub(crate) fn members(path: &Path, file: &mut File) -> Result<Vec<Member>, FileError> {
    let io = |source| FileError::Io { file: path.to_owned(), source };
    let size = file.seek(SeekFrom::End(0)).map_err(io)?;
    let begin = size.saturating_sub(MAX_END_BYTES + 20);
    file.seek(SeekFrom::Start(begin)).map_err(io)?;
    let mut tail = Vec::new();
    file.by_ref().take(MAX_END_BYTES + 20).read_to_end(&mut tail).map_err(io)?;
    let cut = || broken(path, "its end", "the list of members is missing: the archive is truncated");
    let end = tail.windows(4).rposition(|word| word == b"PK\x05\x06").ok_or_else(cut)?;
    let field = |from: usize, at: usize| {
        tail.get(from..).map(|rest| Bytes::new(rest, false)).and_then(|mut bytes| {
            bytes.take(at)?;
            Some(bytes)
        })
    };
    let mut bytes = field(end, 12).ok_or_else(cut)?;
    let (mut length, mut start) = (u64::from(bytes.u32().ok_or_else(cut)?), u64::from(bytes.u32().ok_or_else(cut)?));
    if let Some(locator) = end.checked_sub(20).filter(|at| tail[*at..].starts_with(b"PK\x06\x07")) {
        let at = field(locator, 8).and_then(|mut bytes| bytes.u64()).ok_or_else(cut)?;
        file.seek(SeekFrom::Start(at)).map_err(io)?;
        let mut record = Vec::new();
        file.by_ref().take(56).read_to_end(&mut record).map_err(io)?;
        let mut bytes = Bytes::new(&record, false);
        if bytes.take(4) != Some(b"PK\x06\x06") || bytes.take(36).is_none() {
            return Err(cut());
        }
        (length, start) = (bytes.u64().ok_or_else(cut)?, bytes.u64().ok_or_else(cut)?);
    }
    if start.checked_add(length).is_none_or(|end| end > size) || length > MAX_LIST_BYTES {
        return Err(cut());
    }
    file.seek(SeekFrom::Start(start)).map_err(io)?;
    let mut list = Vec::new();
    file.by_ref().take(length).read_to_end(&mut list).map_err(io)?;
    let mut bytes = Bytes::new(&list, false);
    let mut members = Vec::new();
    while bytes.left() > 0 {
        let member = member(&mut bytes)
            .ok_or_else(|| broken(path, &format!("member {}", members.len()), "its entry in the list is invalid"))?;
        members.push(member);
    }
    Ok(members)
}

fn member(bytes: &mut Bytes) -> Option<Member> {
    if bytes.take(4)? != b"PK\x01\x02" {
        return None;
    }
    bytes.take(6)?;
    let method = bytes.u16()?;
    bytes.take(4)?;
    let crc = bytes.u32()?;
    let (mut packed, unpacked) = (u64::from(bytes.u32()?), bytes.u32()?);
    let [name, extra, comment] = [bytes.u16()?, bytes.u16()?, bytes.u16()?].map(usize::from);
    bytes.take(8)?;
    let mut header = u64::from(bytes.u32()?);
    let name = String::from_utf8_lossy(bytes.take(name)?).into_owned();
    let mut extra = Bytes::new(bytes.take(extra)?, false);
    bytes.take(comment)?;
    while extra.left() >= 4 {
        let (tag, length) = (extra.u16()?, extra.u16()?);
        let mut field = Bytes::new(extra.take(usize::from(length))?, false);
        if tag == 1 {
            // Only the sizes that exceed 32 bits are present, in this order.
            if unpacked == u32::MAX {
                field.u64()?;
            }
            if packed == u64::from(u32::MAX) {
                packed = field.u64()?;
            }
            if header == u64::from(u32::MAX) {
                header = field.u64()?;
            }
        }
    }
    Some(Member { name, method, crc, packed, header })
}

/// Reads the decompressed bytes of a member and computes their checksum.
pub(crate) struct Contents<'a> {
    reader: Box<dyn Read + 'a>,
    hasher: crc32fast::Hasher,
    place: String,
    crc: u32,
}

impl Read for Contents<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let read = self.reader.read(buffer)?;
        self.hasher.update(&buffer[..read]);
        Ok(read)
    }
}

impl Contents<'_> {
    /// Reads to the end and compares the checksum with that in the directory of the archive.
    ///
    /// # Errors
    /// If they differ, because bytes were changed.
    pub(crate) fn verify(mut self, path: &Path) -> Result<(), FileError> {
        let mut block = [0; 1 << 12];
        loop {
            match self.read(&mut block) {
                Ok(0) => break,
                Ok(_) => {}
                Err(error) => return Err(broken(path, &self.place, &format!("it cannot be decompressed ({error})"))),
            }
        }
        if self.hasher.finalize() == self.crc {
            return Ok(());
        }
        Err(broken(path, &self.place, "its bytes do not match their checksum (CRC-32): the file is damaged"))
    }
}

pub(crate) fn contents<'a>(path: &Path, file: &'a mut File, member: &Member) -> Result<Contents<'a>, FileError> {
    let io = |source| FileError::Io { file: path.to_owned(), source };
    let place = format!("member `{}`", member.name);
    file.seek(SeekFrom::Start(member.header)).map_err(io)?;
    let mut header = Vec::new();
    file.by_ref().take(30).read_to_end(&mut header).map_err(io)?;
    let mut bytes = Bytes::new(&header, false);
    let [name, extra] = (bytes.take(4) == Some(b"PK\x03\x04"))
        .then(|| bytes.take(22))
        .flatten()
        .and_then(|_| Some([bytes.u16()?, bytes.u16()?]))
        .ok_or_else(|| broken(path, &place, "its header is invalid"))?;
    let mut own_name = Vec::new();
    file.by_ref().take(u64::from(name)).read_to_end(&mut own_name).map_err(io)?;
    if String::from_utf8_lossy(&own_name) != member.name {
        return Err(broken(path, &place, "its header has another name: the file is damaged"));
    }
    file.seek(SeekFrom::Current(i64::from(extra))).map_err(io)?;
    let packed = file.take(member.packed);
    let reader: Box<dyn Read + 'a> = match member.method {
        0 => Box::new(packed),
        #[cfg(feature = "gzip")]
        8 => Box::new(flate2::bufread::DeflateDecoder::new(std::io::BufReader::new(packed))),
        #[cfg(not(feature = "gzip"))]
        8 => {
            let format = "a compressed NumPy archive";
            return Err(FileError::NotBuilt { file: path.to_owned(), format, feature: "gzip" });
        }
        _ => {
            return Err(FileError::broken(
                path,
                FileFormat::Npz,
                place,
                "its compression is not deflate",
                "write it with numpy.savez or numpy.savez_compressed",
            ));
        }
    };
    Ok(Contents { reader, hasher: crc32fast::Hasher::new(), place, crc: member.crc })
}
