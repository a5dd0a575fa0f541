//! The formats that are read.

/// A format that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum FileFormat {
    /// Text; a table of it is made by others.
    Text,
    /// Text packed by gzip.
    GzipText,
    /// Text packed by Zstandard.
    ZstdText,
    /// One JSON object a line.
    JsonLines,
    /// One NumPy array.
    Npy,
    /// Several NumPy arrays.
    Npz,
    /// MCAP.
    Mcap,
    /// An SQLite file of rosbag2, or a folder of rosbag2 in either storage.
    Rosbag2,
    /// Parquet.
    Parquet,
    /// The folder of a LeRobot data set.
    LeRobot,
    /// Arrow, in the file format (Feather) or as a stream.
    Arrow,
    /// DIAdem data, which KUKA's controllers write.
    Diadem,
    /// MATLAB, `save -v6` and `-v7`.
    Mat5,
    /// HDF5, which MATLAB's `save -v7.3` writes too.
    Hdf5,
}

impl FileFormat {
    /// What it is called.
    pub fn name(self) -> &'static str {
        match self {
            Self::Text => "text",
            Self::GzipText => "gzip",
            Self::ZstdText => "Zstandard",
            Self::JsonLines => "JSON lines",
            Self::Npy => "NumPy array",
            Self::Npz => "NumPy archive",
            Self::Mcap => "MCAP",
            Self::Rosbag2 => "rosbag2",
            Self::Parquet => "Parquet",
            Self::LeRobot => "LeRobot data set",
            Self::Arrow => "Arrow",
            Self::Diadem => "DIAdem data (KUKA trace)",
            Self::Mat5 => "MATLAB 5 file",
            Self::Hdf5 => "HDF5 file",
        }
    }
}
