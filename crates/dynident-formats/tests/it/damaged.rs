//! Damaged and malicious files: checksums reveal flipped bytes, and compressed numbers that would fill the memory are
//! rejected before decompression.

use super::golden::folder;
use dynident_formats::{Contents, FileError, ReadLimits, open, open_within};
use std::io::Read;
#[cfg(feature = "gzip")]
use std::io::Write;
use std::path::Path;

/// All contents of a file as bits; or the error.
fn all(path: &Path) -> Result<(Vec<u64>, bool), FileError> {
    let mut bits = Vec::new();
    match open(path)?.contents {
        Contents::Text(mut text) => {
            let mut bytes = Vec::new();
            let read = text.read_to_end(&mut bytes);
            read.map_err(|source| FileError::Io { file: path.to_owned(), source })?;
            bits.extend(bytes.into_iter().map(u64::from));
            Ok((bits, false))
        }
        Contents::Table(mut table) => {
            bits.extend(table.names().into_iter().flatten().flat_map(|name| name.bytes().map(u64::from)));
            table.all_rows(&mut |_, row| bits.extend(row.iter().map(|value| value.to_bits())))?;
            Ok((bits, table.truncated()))
        }
    }
}

/// A flipped byte causes an error or is in an unused place; it never changes the numbers.
#[test]
fn flipped_bytes_never_give_other_numbers() {
    let scratch = tempfile::tempdir().unwrap();
    let path = scratch.path().join("damaged.log");
    for file in ["stored.npz", "packed.npz", "table.csv.gz", "plain.mcap", "protobuf.mcap"] {
        let whole = std::fs::read(folder().join(file)).unwrap();
        std::fs::write(&path, &whole).unwrap();
        let (expected, _) = all(&path).unwrap();
        let mut refused = 0;
        // The list at the end of an archive has no checksum: with a changed ending of its name, a member is not an
        // array.
        let end = whole.windows(4).position(|word| word == b"PK\x01\x02").unwrap_or(whole.len());
        let steps = 150.min(end);
        // The first bytes determine the format, so skip them.
        for k in (0..steps).filter(|k| end * k / steps >= 8) {
            let mut bytes = whole.clone();
            bytes[end * k / steps] ^= 0x40;
            std::fs::write(&path, &bytes).unwrap();
            match all(&path) {
                Err(_) => refused += 1,
                // A corrupt length truncates a bag, which is reported.
                Ok((_, true)) => {}
                Ok((found, false)) => assert!(found == expected, "{file}, byte {}", end * k / steps),
            }
        }
        assert!(refused > 0, "{file}");
    }
}

#[test]
fn a_damaged_member_of_an_archive_is_named() {
    let scratch = tempfile::tempdir().unwrap();
    let path = scratch.path().join("damaged.npz");
    let array = npy("(4,)", &[1.0_f64, 2.0, 3.0, 4.0].map(f64::to_le_bytes).concat());
    let mut bytes = archive(&[("time", &array), ("q1", &array)], false);
    std::fs::write(&path, &bytes).unwrap();
    assert!(all(&path).is_ok());
    // The last byte of the second array: sign and exponent.
    let at = bytes.windows(4).position(|word| word == b"PK\x01\x02").unwrap() - 1;
    bytes[at] ^= 0x40;
    std::fs::write(&path, &bytes).unwrap();
    let message = all(&path).unwrap_err().to_string();
    assert!(message.contains("member `q1.npy`") && message.contains("checksum (CRC-32)"), "{message}");
}

/// 8 GB of zeros in a file of a few hundred bytes or kilobytes are rejected before decompression.
#[cfg(feature = "gzip")]
#[test]
fn packed_numbers_do_not_fill_the_memory() {
    let scratch = tempfile::tempdir().unwrap();
    let path = scratch.path().join("bomb");
    let zeros = vec![0; 1 << 20];
    let started = std::time::Instant::now();
    let refused = |bytes: &[u8], words: &str| {
        std::fs::write(&path, bytes).unwrap();
        let message = open(&path).unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    };
    refused(&archive(&[("t_s", &npy("(1000000000,)", &zeros))], true), "128 MiB of memory");
    // One column of bytes, each of which needs eight bytes in memory.
    refused(&archive(&[("t_s", &npy_of("|u1", "(100000000,)", &zeros))], true), "128 MiB of memory");
    refused(&mat(&matrix(1 << 28, &zeros)), "128 MiB of memory");
    // A matrix that declares 2 GiB and consists of zeros.
    let mut hollow = [14_u32.to_le_bytes(), 0x7fff_fff0_u32.to_le_bytes()].concat();
    hollow.extend((0..16).flat_map(|_| zeros.iter().copied()));
    refused(&mat(&hollow), "variable 0");
    assert!(started.elapsed().as_secs() < 20);

    // Valid contents are read, also with a smaller limit that is sufficient.
    let small = mat(&matrix(1000, &[0; 8000]));
    std::fs::write(&path, &small).unwrap();
    assert!(open(&path).is_ok());
    let limits = ReadLimits { memory_bytes: 7999, ..ReadLimits::default() };
    assert!(open_within(&path, &limits).unwrap_err().to_string().contains("ReadLimits"));
    assert!(open_within(&path, &ReadLimits { memory_bytes: 8000, ..limits }).is_ok());
}

fn npy(shape: &str, data: &[u8]) -> Vec<u8> {
    npy_of("<f8", shape, data)
}

fn npy_of(kind: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n");
    let length = u16::try_from(header.len()).unwrap().to_le_bytes();
    [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), data].concat()
}

fn archive(members: &[(&str, &[u8])], packed: bool) -> Vec<u8> {
    let (mut bytes, mut list) = (Vec::new(), Vec::new());
    for (name, data) in members {
        let name = format!("{name}.npy");
        let body = if packed { deflated(data) } else { data.to_vec() };
        let sizes = [crc32fast::hash(data), body.len() as u32, data.len() as u32].map(u32::to_le_bytes).concat();
        let method = if packed { 8_u16 } else { 0 }.to_le_bytes();
        let length = u16::try_from(name.len()).unwrap().to_le_bytes();
        let at = (bytes.len() as u32).to_le_bytes();
        let common = [&[20, 0, 0, 0][..], &method, &[0; 4], &sizes, &length].concat();
        bytes.extend([b"PK\x03\x04", &common[..], &[0; 2], name.as_bytes(), &body].concat());
        list.extend([b"PK\x01\x02\x14\0", &common[..], &[0; 12], &at, name.as_bytes()].concat());
    }
    let count = u16::try_from(members.len()).unwrap().to_le_bytes();
    let (at, length) = ((bytes.len() as u32).to_le_bytes(), (list.len() as u32).to_le_bytes());
    bytes.extend(list);
    bytes.extend([b"PK\x05\x06", &[0; 4][..], &count, &count, &length, &at, &[0; 2]].concat());
    bytes
}

#[cfg(feature = "gzip")]
fn deflated(data: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::best());
    encoder.write_all(data).unwrap();
    encoder.finish().unwrap()
}

#[cfg(not(feature = "gzip"))]
fn deflated(_: &[u8]) -> Vec<u8> {
    Vec::new()
}

/// A MATLAB file with one compressed element.
#[cfg(feature = "gzip")]
fn mat(element: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
    encoder.write_all(element).unwrap();
    let packed = encoder.finish().unwrap();
    let mut bytes = b"MATLAB 5.0 MAT-file".to_vec();
    bytes.resize(124, b' ');
    bytes.extend(b"\x00\x01IM");
    bytes.extend([15_u32.to_le_bytes(), (packed.len() as u32).to_le_bytes()].concat());
    bytes.extend(packed);
    bytes
}

/// A matrix element that declares `count` doubles in one column and contains `data`.
#[cfg(feature = "gzip")]
fn matrix(count: u32, data: &[u8]) -> Vec<u8> {
    let words = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<_>>();
    let size = count * 8;
    let flags = words(&[6, 8, 6, 0]);
    let sides = words(&[5, 8, count, 1]);
    let name = [&words(&[1 << 16 | 1])[..], b"q\0\0\0"].concat();
    let numbers = [&words(&[9, size])[..], data].concat();
    let inside = [flags, sides, name, numbers].concat();
    [&words(&[14, (inside.len() as u32).max(size)])[..], &inside].concat()
}
