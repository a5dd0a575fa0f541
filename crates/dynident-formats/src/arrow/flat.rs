//! FlatBuffers tables, in which Arrow stores its schema and the places of its columns. Every offset is checked; a field
//! with an offset outside the bytes is treated as absent. Format: <https://flatbuffers.dev/internals>.

use crate::bytes::Bytes;

/// One table; fields are addressed by slot number.
#[derive(Clone, Copy, Debug)]
pub(super) struct Flat<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Flat<'a> {
    pub(super) fn root(bytes: &'a [u8]) -> Option<Self> {
        Self { bytes, at: 0 }.followed(0)
    }

    fn read(&self, at: usize) -> Option<Bytes<'a>> {
        Some(Bytes::new(self.bytes.get(at..)?, false))
    }

    /// The table to which the offset stored at `at` refers.
    fn followed(&self, at: usize) -> Option<Self> {
        Some(Self { bytes: self.bytes, at: self.pointed(at)? })
    }

    /// The position to which the offset stored at `at` refers.
    fn pointed(&self, at: usize) -> Option<usize> {
        let offset = self.read(at)?.u32()?;
        at.checked_add(offset as usize).filter(|place| *place < self.bytes.len())
    }

    fn place(&self, slot: usize) -> Option<usize> {
        let back = i64::from(self.read(self.at)?.u32()? as i32);
        let list = usize::try_from(self.at as i64 - back).ok()?;
        let size = usize::from(self.read(list)?.u16()?);
        let entry = 4 + 2 * slot;
        if entry + 2 > size {
            return None;
        }
        match self.read(list + entry)?.u16()? {
            0 => None,
            offset => self.at.checked_add(usize::from(offset)),
        }
    }

    /// A one-byte number; 0 if the field is absent, also in the following methods.
    pub(super) fn u8(&self, slot: usize) -> u8 {
        self.place(slot).and_then(|at| self.read(at)?.u8()).unwrap_or(0)
    }

    pub(super) fn i16(&self, slot: usize) -> Option<i16> {
        self.place(slot).and_then(|at| self.read(at)?.u16()).map(|bits| bits as i16)
    }

    pub(super) fn i32(&self, slot: usize) -> i32 {
        self.place(slot).and_then(|at| self.read(at)?.u32()).unwrap_or(0) as i32
    }

    pub(super) fn i64(&self, slot: usize) -> i64 {
        self.place(slot).and_then(|at| self.read(at)?.u64()).unwrap_or(0) as i64
    }

    pub(super) fn table(&self, slot: usize) -> Option<Self> {
        self.followed(self.place(slot)?)
    }

    pub(super) fn text(&self, slot: usize) -> Option<String> {
        let mut bytes = self.read(self.pointed(self.place(slot)?)?)?;
        let length = bytes.u32()? as usize;
        Some(String::from_utf8_lossy(bytes.take(length)?).into_owned())
    }

    pub(super) fn tables(&self, slot: usize) -> impl Iterator<Item = Self> + use<'a> {
        let place = self.place(slot).and_then(|at| self.pointed(at));
        let count = place.and_then(|at| self.read(at)?.u32()).unwrap_or(0) as usize;
        let list = *self;
        (0..count).map_while(move |k| list.followed(place?.checked_add(4 + 4 * k)?))
    }

    /// A list of tuples of `WIDTH` 64-bit integers.
    pub(super) fn numbers<const WIDTH: usize>(&self, slot: usize) -> Vec<[i64; WIDTH]> {
        let Some(mut bytes) = self.place(slot).and_then(|at| self.read(self.pointed(at)?)) else { return Vec::new() };
        let count = bytes.u32().unwrap_or(0) as usize;
        let mut read = || {
            let mut numbers = [0; WIDTH];
            for number in &mut numbers {
                *number = bytes.u64()? as i64;
            }
            Some(numbers)
        };
        (0..count).map_while(|_| read()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_outside_the_bytes_are_absent() {
        // Offset of the table 12; its vtable at 4 (size 8, table size 8, slot 0 at 4, slot 1 at 6).
        let mut bytes = vec![12, 0, 0, 0, 8, 0, 8, 0, 4, 0, 6, 0, 8, 0, 0, 0, 7, 1, 255, 255];
        let table = Flat::root(&bytes).unwrap();
        assert_eq!((table.u8(0), table.i16(1), table.u8(2)), (7, Some(-1), 0));
        assert!(table.table(0).is_none() && table.text(0).is_none() && table.tables(0).next().is_none());
        assert!(table.numbers::<1>(0).is_empty());
        bytes[12] = 200;
        assert_eq!(Flat::root(&bytes).unwrap().u8(0), 0);
        bytes[0] = 20;
        assert!(Flat::root(&bytes).is_none());
    }
}
