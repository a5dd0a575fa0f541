//! The wire format of Protocol Buffers: fields with their numbers and values.

/// The value of a field, not yet interpreted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum WireValue<'a> {
    Varint(u64),
    Fixed64(u64),
    Fixed32(u32),
    /// A text, bytes, a message, or packed numbers.
    Bytes(&'a [u8]),
}

/// The fields of a message in their order on the wire.
#[derive(Clone, Copy, Debug)]
pub(super) struct WireFields<'a> {
    bytes: &'a [u8],
}

impl<'a> WireFields<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let (taken, rest) = self.bytes.split_at_checked(count).ok_or_else(truncated)?;
        self.bytes = rest;
        Ok(taken)
    }

    pub(super) fn varint(&mut self) -> Result<u64, String> {
        let mut value = 0;
        for (place, &byte) in self.bytes.iter().take(10).enumerate() {
            value |= u64::from(byte & 0x7f) << (7 * place);
            if byte < 0x80 {
                self.bytes = &self.bytes[place + 1..];
                return Ok(value);
            }
        }
        Err(if self.bytes.len() < 10 { truncated() } else { "a number in it is longer than 10 bytes".to_owned() })
    }

    pub(super) fn fixed64(&mut self) -> Result<u64, String> {
        Ok(u64::from_le_bytes(self.take(8)?.try_into().map_err(|_| truncated())?))
    }

    pub(super) fn fixed32(&mut self) -> Result<u32, String> {
        Ok(u32::from_le_bytes(self.take(4)?.try_into().map_err(|_| truncated())?))
    }

    /// The next field: its number and its value; `None` at the end.
    ///
    /// # Errors
    /// The problem of the message.
    pub(super) fn next_field(&mut self) -> Result<Option<(u32, WireValue<'a>)>, String> {
        if self.is_empty() {
            return Ok(None);
        }
        let tag = self.varint()?;
        let number = u32::try_from(tag >> 3).ok().filter(|number| *number > 0);
        let number = number.ok_or_else(|| format!("its field number {} is invalid", tag >> 3))?;
        let value = match tag & 7 {
            0 => WireValue::Varint(self.varint()?),
            1 => WireValue::Fixed64(self.fixed64()?),
            2 => {
                let length = usize::try_from(self.varint()?).map_err(|_| truncated())?;
                WireValue::Bytes(self.take(length)?)
            }
            5 => WireValue::Fixed32(self.fixed32()?),
            3 | 4 => return Err("it contains a group, which proto3 does not have".to_owned()),
            other => return Err(format!("its wire type {other} is unknown")),
        };
        Ok(Some((number, value)))
    }
}

fn truncated() -> String {
    "it is truncated".to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Examples of the specification.
    #[test]
    fn fields_are_those_of_the_specification() {
        let mut fields = WireFields::new(b"\x08\x96\x01\x12\x07testing\x1a\x03\x08\x96\x01");
        assert_eq!(fields.next_field(), Ok(Some((1, WireValue::Varint(150)))));
        assert_eq!(fields.next_field(), Ok(Some((2, WireValue::Bytes(b"testing")))));
        assert_eq!(fields.next_field(), Ok(Some((3, WireValue::Bytes(b"\x08\x96\x01")))));
        assert_eq!(fields.next_field(), Ok(None));
        // -2 as int64.
        let mut number = WireFields::new(b"\xfe\xff\xff\xff\xff\xff\xff\xff\xff\x01");
        assert_eq!(number.varint().map(|value| value as i64), Ok(-2));
    }

    #[test]
    fn broken_messages_are_refused() {
        for bytes in [
            &b"\x08"[..],
            b"\x80",
            &[0xff; 20],
            b"\x09\x00",
            b"\x12\x05ab",
            b"\x00\x01",
            b"\x0b",
            b"\x0e",
            b"\x12\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01",
        ] {
            assert!(WireFields::new(bytes).next_field().is_err(), "{bytes:?}");
        }
    }
}
