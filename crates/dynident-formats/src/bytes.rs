//! Reads numbers from bytes with bounds checks.

/// Bytes in a byte order, read from the front. Every read returns `None` at the end of the bytes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bytes<'a> {
    all: &'a [u8],
    at: usize,
    big_endian: bool,
}

macro_rules! numbers {
    ($($name:ident $kind:ty, $size:literal;)*) => {
        $(
            pub(crate) fn $name(&mut self) -> Option<$kind> {
                let bytes: [u8; $size] = self.take($size)?.try_into().ok()?;
                Some(if self.big_endian { <$kind>::from_be_bytes(bytes) } else { <$kind>::from_le_bytes(bytes) })
            }
        )*
    };
}

impl<'a> Bytes<'a> {
    pub(crate) fn new(all: &'a [u8], big_endian: bool) -> Self {
        Self { all, at: 0, big_endian }
    }

    pub(crate) fn left(&self) -> usize {
        self.all.len() - self.at
    }

    pub(crate) fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let taken = self.all.get(self.at..self.at.checked_add(count)?)?;
        self.at += count;
        Some(taken)
    }

    /// Moves to the next multiple of `size`, a power of two, counted from the first byte.
    pub(crate) fn align(&mut self, size: usize) -> Option<()> {
        let padding = self.at.wrapping_neg() & (size - 1);
        self.take(padding).map(|_| ())
    }

    numbers! {
        u8 u8, 1;
        u16 u16, 2;
        u32 u32, 4;
        u64 u64, 8;
    }

    pub(crate) fn number(&mut self, kind: Number) -> Option<f64> {
        Some(match kind {
            Number::U8 => f64::from(self.u8()?),
            Number::I8 => f64::from(self.u8()? as i8),
            Number::U16 => f64::from(self.u16()?),
            Number::I16 => f64::from(self.u16()? as i16),
            Number::U32 => f64::from(self.u32()?),
            Number::I32 => f64::from(self.u32()? as i32),
            Number::U64 => self.u64()? as f64,
            Number::I64 => self.u64()? as i64 as f64,
            Number::F16 => half(self.u16()?),
            Number::F32 => f64::from(f32::from_bits(self.u32()?)),
            Number::F64 => f64::from_bits(self.u64()?),
        })
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Number {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F16,
    F32,
    F64,
}

impl Number {
    pub(crate) fn size(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 | Self::F16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }
}

/// Converts an IEEE 754 number of 16 bits.
fn half(bits: u16) -> f64 {
    let (sign, exponent, fraction) =
        (if bits >> 15 == 0 { 1.0 } else { -1.0 }, i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    sign * match exponent {
        0 => fraction * 2f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1.0 + fraction / 1024.0) * 2f64.powi(exponent - 15),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_precision_follows_the_standard() {
        let cases =
            [(0x3C00, 1.0), (0xC000, -2.0), (0x7BFF, 65504.0), (0x0400, 2f64.powi(-14)), (0x0001, 2f64.powi(-24))];
        for (bits, value) in cases {
            assert_eq!(half(bits), value, "{bits:x}");
        }
        assert!(half(0x7E00).is_nan() && half(0xFC00) == f64::NEG_INFINITY);
    }

    #[test]
    fn missing_bytes_are_not_read() {
        let mut bytes = Bytes::new(&[1, 0, 0, 0, 2], false);
        assert_eq!((bytes.u32(), bytes.u16(), bytes.align(8)), (Some(1), None, None));
        assert_eq!((bytes.number(Number::I8), bytes.left(), bytes.take(usize::MAX)), (Some(2.0), 0, None));
    }
}
