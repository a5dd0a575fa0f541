//! Seeds and their mutations.

use std::path::Path;

/// Maximum length of a mutated input, bytes.
const LONGEST: usize = 1 << 17;

/// Numbers that often cause arithmetic errors.
const NUMBERS: [&str; 26] = [
    "0",
    "-0",
    "1",
    "-1",
    "1e-320",
    "1e-300",
    "-1e300",
    "1e308",
    "1e309",
    "1e160",
    "nan",
    "inf",
    "-inf",
    "NaN",
    "0.1",
    "1.8e19",
    "18446744073709551615",
    "18446744073709551616",
    "-9223372036854775808",
    "9223372036854775807",
    "4294967296",
    "65536",
    "1e9",
    "3.141592654",
    "1e-9",
    "1e15",
];

/// The seeds of one target: files of `corpus/NAME`, with their names.
pub(crate) struct Corpus {
    seeds: Vec<(String, Vec<u8>)>,
}

impl Corpus {
    /// The files of `corpus/name`, in the order of their names.
    pub(crate) fn read(name: &str) -> Result<Self, std::io::Error> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(name);
        let mut seeds = Vec::new();
        for entry in std::fs::read_dir(folder)? {
            let path = entry?.path();
            let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
            seeds.push((name, std::fs::read(path)?));
        }
        seeds.sort();
        Ok(Self { seeds })
    }
}

/// Creates mutated inputs; equal seed numbers create equal inputs.
pub(crate) struct Mutator {
    state: u64,
}

impl Mutator {
    pub(crate) fn new(seed: u64, number: u64, target: u64) -> Self {
        let mut mutator = Self { state: seed ^ number.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ (target << 56) };
        mutator.next();
        mutator
    }

    /// SplitMix64 (Steele, Lea and Flood 2014).
    fn next(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() % end.max(1) as u64) as usize
    }

    /// Returns the name of a seed, and the seed with one mutation, half as often with two, and so on.
    pub(crate) fn input<'a>(&mut self, corpus: &'a Corpus) -> (&'a str, Vec<u8>) {
        let (name, seed) = &corpus.seeds[self.below(corpus.seeds.len())];
        let mut bytes = seed.clone();
        for _ in 0..=self.next().trailing_zeros() {
            self.mutate(&mut bytes, corpus);
            bytes.truncate(LONGEST);
        }
        (name, bytes)
    }

    fn mutate(&mut self, bytes: &mut Vec<u8>, corpus: &Corpus) {
        let at = self.below(bytes.len() + 1);
        match self.below(12) {
            0 => {
                if let Some(byte) = bytes.get_mut(at) {
                    *byte ^= 1 << (self.next() % 8);
                }
            }
            1 => bytes.insert(at, (self.next() % 256) as u8),
            2 => {
                let end = (at + 1 + self.below(16)).min(bytes.len());
                bytes.drain(at.min(end)..end);
            }
            3 => {
                let end = (at + 1 + self.below(200)).min(bytes.len());
                let piece = bytes[at.min(end)..end].to_vec();
                let to = self.below(bytes.len() + 1);
                bytes.splice(to..to, piece);
            }
            // Insert a piece of another seed.
            4 => {
                let (_, other) = &corpus.seeds[self.below(corpus.seeds.len())];
                let from = self.below(other.len());
                let end = (from + self.below(120)).min(other.len());
                bytes.splice(at..at, other[from..end].to_vec());
            }
            5 => bytes.truncate(at),
            // Duplicate or delete a line.
            6 | 7 => {
                let line = line_around(bytes, at);
                if self.next().is_multiple_of(2) {
                    let copy = bytes[line.clone()].to_vec();
                    bytes.splice(line.start..line.start, copy);
                } else {
                    bytes.drain(line);
                }
            }
            // Replace a number; this is the most frequent cause of arithmetic errors.
            _ => {
                let Some(range) = number_after(bytes, at) else { return };
                let new = NUMBERS[self.below(NUMBERS.len())];
                bytes.splice(range, new.bytes());
            }
        }
    }
}

fn line_around(bytes: &[u8], at: usize) -> core::ops::Range<usize> {
    let start = bytes[..at].iter().rposition(|byte| *byte == b'\n').map_or(0, |newline| newline + 1);
    let end = bytes[at..].iter().position(|byte| *byte == b'\n').map_or(bytes.len(), |newline| at + newline + 1);
    start..end
}

/// Finds the first number that begins at `at` or later.
fn number_after(bytes: &[u8], at: usize) -> Option<core::ops::Range<usize>> {
    let start = at + bytes[at..].iter().position(u8::is_ascii_digit)?;
    let part = |byte: &u8| byte.is_ascii_digit() || matches!(byte, b'.' | b'-' | b'+' | b'e' | b'E');
    let length = bytes[start..].iter().position(|byte| !part(byte)).unwrap_or(bytes.len() - start);
    Some(start..start + length)
}

#[cfg(test)]
mod tests {
    use super::{Corpus, Mutator};

    #[test]
    fn the_same_numbers_make_the_same_input() {
        let seeds = [("a".to_owned(), b"mass = 1.5\nname = \"x\"\n".to_vec()), ("b".to_owned(), Vec::new())];
        let corpus = Corpus { seeds: seeds.to_vec() };
        let made = |seed: u64| -> Vec<(String, Vec<u8>)> {
            (0..500)
                .map(|number| {
                    let mut mutator = Mutator::new(seed, number, 3);
                    let (name, bytes) = mutator.input(&corpus);
                    (name.to_owned(), bytes)
                })
                .collect()
        };
        assert_eq!(made(1), made(1));
        assert_ne!(made(1), made(2));
        let changed = made(1).iter().filter(|(name, bytes)| name == "a" && *bytes != seeds[0].1).count();
        assert!(changed > 150, "{changed}");
    }
}
