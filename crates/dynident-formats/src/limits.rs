//! Memory limits for the contents of a file.

/// Memory limits for the numbers of one file, for formats that are held in memory completely (NumPy, MATLAB, HDF5,
/// DIAdem) and for one batch of Arrow. Text, JSON lines, Parquet and bags are read in pieces.
///
/// A file of `n` bytes may use `min(memory_bytes, max(always_bytes, expansion · n))`. Measured on 13 logs of four arms
/// as doubles: compression by zlib reduces a log by factors of 1.1 to 2.9, and a column of one repeated value by 680.
/// Compressed numbers that expand more than `expansion` times beyond `always_bytes` are not a recording of a robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadLimits {
    /// Maximum memory, bytes. Default 2 GiB.
    pub memory_bytes: u64,
    /// Memory that a file of any length may use, bytes. Default 128 MiB.
    pub always_bytes: u64,
    /// Maximum number of bytes in memory per byte of the file. Default 100.
    pub expansion: u64,
}

impl Default for ReadLimits {
    fn default() -> Self {
        Self { memory_bytes: 1 << 31, always_bytes: 1 << 27, expansion: 100 }
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Budget {
    all: u64,
    left: u64,
}

pub(crate) const SPLIT_FIX: &str = "split the recording, or save it as text or Parquet, which are read in pieces (from Rust, `ReadLimits` is the limit)";

impl Budget {
    pub(crate) fn new(limits: &ReadLimits, file_bytes: u64) -> Self {
        let own = file_bytes.saturating_mul(limits.expansion).max(limits.always_bytes);
        let all = own.min(limits.memory_bytes);
        Self { all, left: all }
    }

    pub(crate) fn allows(&self, bytes: Option<u64>) -> bool {
        bytes.is_some_and(|bytes| bytes <= self.left)
    }

    /// Subtracts memory from the remaining budget.
    ///
    /// # Errors
    /// The problem, if less memory is left; `None` is an overflow.
    pub(crate) fn take(&mut self, bytes: Option<u64>) -> Result<(), String> {
        match bytes.filter(|bytes| *bytes <= self.left) {
            Some(bytes) => {
                self.left -= bytes;
                Ok(())
            }
            None => Err(self.problem()),
        }
    }

    pub(crate) fn problem(&self) -> String {
        format!("its numbers need more than {} MiB of memory, the limit for a file of this length", self.all >> 20)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_file_may_not_fill_the_memory() {
        let limits = ReadLimits::default();
        for (file_bytes, all) in [(0, 1 << 27), (1 << 20, 1 << 27), (10 << 20, 1000 << 20), (u64::MAX, 1 << 31)] {
            assert_eq!(Budget::new(&limits, file_bytes).all, all);
        }
        let mut budget = Budget::new(&limits, 0);
        assert!(budget.take(Some(1 << 26)).is_ok() && budget.take(Some(1 << 26)).is_ok());
        assert!(budget.take(Some(1)).unwrap_err().contains("128 MiB") && budget.take(None).is_err());
    }
}
