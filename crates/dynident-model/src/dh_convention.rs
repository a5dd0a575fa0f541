//! The two conventions of Denavit-Hartenberg tables.

use serde::Deserialize;

/// Convention of the frames of a D-H table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum DhConvention {
    /// Frame transformation `Rz(θ) Tz(d) Tx(a) Rx(α)` (Denavit and Hartenberg 1955; Paul 1981).
    Standard,
    /// Frame transformation `Rx(α) Tx(a) Rz(θ) Tz(d)` (Craig 1986; Khalil and Kleinfinger 1986).
    Modified,
}

impl DhConvention {
    /// The other convention.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::Standard => Self::Modified,
            Self::Modified => Self::Standard,
        }
    }

    /// Name in D-H tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Standard => "standard",
            Self::Modified => "modified",
        }
    }
}
