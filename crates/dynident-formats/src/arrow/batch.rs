//! Columns of one Arrow record batch: finds, decompresses and checks its buffers, so that values can then be read
//! without errors.

use super::flat::Flat;
use super::schema::{Cell, Leaf, List, Place};
use crate::bytes::Bytes;
use crate::limits::Budget;
use std::fs::File;
use std::io::{BufReader, Read, Seek};

/// Maximum number of padding bytes after a buffer; the format aligns buffers to 64 bytes.
const MAX_PADDING_BYTES: u64 = 128;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Packing {
    Plain,
    Lz4,
    Zstd,
}

#[derive(Debug)]
pub(super) struct Batch {
    pub(super) rows: usize,
    /// Number of entries of each field.
    entries: Vec<usize>,
    /// Offset and length of each buffer, and the number of additional buffers of each view field (Arrow's layout for
    /// texts in several buffers).
    buffers: Vec<[i64; 2]>,
    views: Vec<[i64; 1]>,
    packing: Packing,
    /// Start of the buffers in the file, and their total length, bytes.
    begin: u64,
    bytes: u64,
}

#[derive(Debug)]
pub(super) struct Loaded {
    cell: Cell,
    around: Vec<Flags>,
    list: Option<(Flags, Offsets)>,
    flags: Flags,
    data: Vec<u8>,
}

/// Validity bitmap; `None` if all entries are valid.
#[derive(Debug)]
struct Flags(Option<Vec<u8>>);

#[derive(Debug)]
enum Offsets {
    Fixed(usize),
    Each(Vec<usize>),
}

impl Flags {
    fn has(&self, at: usize) -> bool {
        self.0.as_ref().is_none_or(|flags| bit(flags, at))
    }
}

/// Moves the reader to `at`; bytes that are already buffered are not read again.
pub(super) fn move_to(reader: &mut BufReader<File>, at: u64) -> std::io::Result<()> {
    let now = reader.stream_position()?;
    reader.seek_relative(at as i64 - now as i64)
}

fn bit(bytes: &[u8], at: usize) -> bool {
    bytes.get(at / 8).is_some_and(|byte| byte >> (at % 8) & 1 == 1)
}

impl Batch {
    pub(super) fn read(message: Flat, begin: u64, bytes: u64) -> Result<Self, String> {
        let batch = message.table(2).ok_or("the description of its columns is missing")?;
        let rows = usize::try_from(batch.i64(0)).map_err(|_| "its number of rows is negative")?;
        let mut entries = Vec::new();
        for [count, _] in batch.numbers::<2>(1) {
            entries.push(usize::try_from(count).map_err(|_| "a column's number of entries is negative")?);
        }
        let packing = match batch.table(3) {
            None => Packing::Plain,
            Some(packing) => match (packing.u8(0), packing.u8(1)) {
                (0, 0) => Packing::Lz4,
                (1, 0) => Packing::Zstd,
                (codec, method) => return Err(format!("unknown compression ({codec}, {method})")),
            },
        };
        Ok(Self { rows, entries, buffers: batch.numbers(2), views: batch.numbers(4), packing, begin, bytes })
    }

    /// Reads a column and subtracts its memory from `left`.
    fn load(&self, leaf: &Leaf, reader: &mut BufReader<File>, left: &mut Budget) -> Result<Loaded, String> {
        // Groups and lists have one entry per row; values inside lists have as many entries as their field.
        let mut around = Vec::new();
        for place in &leaf.around {
            around.push(self.flags(*place, self.rows, reader, left)?);
        }
        let mut entries = self.rows;
        let mut list = None;
        if let Some((place, kind)) = leaf.list {
            let flags = self.flags(place, self.rows, reader, left)?;
            entries = *self.entries.get(leaf.value.node).ok_or("a field is missing")?;
            let offsets = match kind {
                List::Fixed(length) if length.checked_mul(self.rows).is_some_and(|all| all <= entries) => {
                    Offsets::Fixed(length)
                }
                List::Fixed(_) => return Err("it has fewer entries than its lists".to_owned()),
                List::Offsets { wide } => self.offsets(place, wide, entries, reader, left)?,
            };
            list = Some((flags, offsets));
        }
        let flags = self.flags(leaf.value, entries, reader, left)?;
        let data = self.buffer(leaf.value, 1, leaf.cell.bytes(entries), reader, left)?;
        Ok(Loaded { cell: leaf.cell, around, list, flags, data })
    }

    pub(super) fn loaded(
        &self,
        leaves: &[Leaf],
        asked_for: impl Fn(usize) -> bool,
        reader: &mut BufReader<File>,
        mut left: Budget,
    ) -> Result<Vec<Option<Loaded>>, (usize, String)> {
        let mut loaded = Vec::with_capacity(leaves.len());
        for (index, leaf) in leaves.iter().enumerate() {
            let column = asked_for(index).then(|| self.load(leaf, reader, &mut left)).transpose();
            loaded.push(column.map_err(|problem| (index, problem))?);
        }
        Ok(loaded)
    }

    /// Index of the `which`-th buffer of a field among the buffers of the batch.
    fn number(&self, place: Place, which: usize) -> usize {
        let views = self.views.iter().take(place.views);
        let more = views.filter_map(|[count]| usize::try_from(*count).ok());
        more.fold(place.buffer + which, usize::saturating_add)
    }

    fn flags(
        &self,
        place: Place,
        entries: usize,
        reader: &mut BufReader<File>,
        left: &mut Budget,
    ) -> Result<Flags, String> {
        // The bitmap may be empty if all entries are valid.
        if self.buffers.get(self.number(place, 0)).is_some_and(|[_, length]| *length == 0) {
            return Ok(Flags(None));
        }
        self.buffer(place, 0, Some(entries.div_ceil(8)), reader, left).map(|flags| Flags(Some(flags)))
    }

    fn offsets(
        &self,
        place: Place,
        wide: bool,
        entries: usize,
        reader: &mut BufReader<File>,
        left: &mut Budget,
    ) -> Result<Offsets, String> {
        if self.rows == 0 {
            return Ok(Offsets::Each(vec![0]));
        }
        let size = if wide { 8 } else { 4 };
        let bytes = self.rows.checked_add(1).and_then(|count| count.checked_mul(size));
        let data = self.buffer(place, 1, bytes, reader, left)?;
        let mut bytes = Bytes::new(&data, false);
        let mut next = || if wide { bytes.u64() } else { bytes.u32().map(u64::from) };
        let mut offsets = Vec::with_capacity(data.len() / size);
        while let Some(offset) = next() {
            let last = offsets.last().copied().unwrap_or(0);
            let inside = usize::try_from(offset).ok().filter(|offset| (last..=entries).contains(offset));
            offsets.push(inside.ok_or_else(|| format!("list {} does not end in its entries", offsets.len()))?);
        }
        Ok(Offsets::Each(offsets))
    }

    /// The first `wanted` bytes of a buffer, decompressed.
    fn buffer(
        &self,
        place: Place,
        which: usize,
        wanted: Option<usize>,
        reader: &mut BufReader<File>,
        left: &mut Budget,
    ) -> Result<Vec<u8>, String> {
        left.take(wanted.map(|wanted| wanted as u64))?;
        let wanted = wanted.unwrap_or_default();
        let [offset, length] = *self.buffers.get(self.number(place, which)).ok_or("a buffer is missing")?;
        let (offset, length) = u64::try_from(offset)
            .ok()
            .zip(u64::try_from(length).ok())
            .ok_or("a buffer has a negative offset or length")?;
        if offset.checked_add(length).is_none_or(|end| end > self.bytes) {
            return Err("its buffer ends after the batch".to_owned());
        }
        let problem = |error: std::io::Error| format!("its buffer cannot be read ({error})");
        move_to(reader, self.begin + offset).map_err(problem)?;
        let mut data = Vec::new();
        let mut packed = reader.take(length);
        let mut unpacked: Box<dyn Read + '_> = if self.packing == Packing::Plain || wanted == 0 {
            Box::new(packed)
        } else {
            let mut claim = [0; 8];
            packed.read_exact(&mut claim).map_err(problem)?;
            match (i64::from_le_bytes(claim), self.packing) {
                // Not compressed.
                (-1, _) => Box::new(packed),
                (_, Packing::Lz4) => Box::new(lz4::Decoder::new(packed).map_err(problem)?),
                (_, _) => {
                    let mut decoder = zstd::stream::read::Decoder::new(packed).map_err(problem)?;
                    decoder.window_log_max(27).map_err(problem)?;
                    Box::new(decoder)
                }
            }
        };
        unpacked.by_ref().take(wanted as u64).read_to_end(&mut data).map_err(problem)?;
        // The checksum of a compressed buffer follows its last byte, possibly after padding.
        if self.packing != Packing::Plain {
            std::io::copy(&mut unpacked.by_ref().take(MAX_PADDING_BYTES), &mut std::io::sink()).map_err(problem)?;
        }
        drop(unpacked);
        if data.len() < wanted {
            return Err(format!("its buffer has {} bytes of {wanted}", data.len()));
        }
        Ok(data)
    }
}

impl Loaded {
    /// Index of entry `entry` of a row in the values; `None` if it is missing.
    fn place(&self, row: usize, entry: usize) -> Option<usize> {
        if self.around.iter().any(|flags| !flags.has(row)) {
            return None;
        }
        let at = match &self.list {
            None => row,
            Some((flags, _)) if !flags.has(row) => return None,
            Some((_, offsets)) => {
                let (begin, end) = offsets.range(row)?;
                begin.checked_add(entry).filter(|at| *at < end)?
            }
        };
        self.flags.has(at).then_some(at)
    }

    /// Value of entry `entry` of a row; time stamps are relative to `first`; NaN if it is missing.
    pub(super) fn value(&self, row: usize, entry: usize, first: i64) -> f64 {
        let Some(at) = self.place(row, entry) else { return f64::NAN };
        match self.cell {
            Cell::Flag => f64::from(u8::from(bit(&self.data, at))),
            Cell::Number(number) => {
                let bytes = self.data.get(at * number.size()..).unwrap_or_default();
                Bytes::new(bytes, false).number(number).unwrap_or(f64::NAN)
            }
            Cell::Ticks { per_s, from_first, .. } => {
                let first = if from_first { first } else { 0 };
                self.ticks(at).map_or(f64::NAN, |ticks| (i128::from(ticks) - i128::from(first)) as f64 / per_s)
            }
        }
    }

    fn ticks(&self, at: usize) -> Option<i64> {
        let Cell::Ticks { wide, .. } = self.cell else { return None };
        let mut bytes = Bytes::new(self.data.get(at * if wide { 8 } else { 4 }..)?, false);
        if wide { bytes.u64().map(|bits| bits as i64) } else { bytes.u32().map(|bits| i64::from(bits as i32)) }
    }

    pub(super) fn first_ticks(&self, rows: usize) -> Option<i64> {
        (0..rows).find_map(|row| self.ticks(self.place(row, 0)?))
    }

    pub(super) fn length(&self, row: usize) -> usize {
        let Some((_, offsets)) = &self.list else { return 1 };
        offsets.range(row).map_or(0, |(begin, end)| end - begin)
    }
}

impl Offsets {
    fn range(&self, row: usize) -> Option<(usize, usize)> {
        match self {
            Self::Fixed(length) => Some((row.checked_mul(*length)?, row.checked_add(1)?.checked_mul(*length)?)),
            Self::Each(offsets) => Some((*offsets.get(row)?, *offsets.get(row + 1)?)),
        }
    }
}
