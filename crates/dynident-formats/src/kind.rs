//! Supported file formats.

/// A supported file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum FileFormat {
    /// Text; its table is parsed by the caller.
    Text,
    /// Text with one line for each quantity instead of one for each sample.
    SidewaysText,
    /// Text with one value on each line and the shape of the array in its header.
    ValueList,
    /// Text compressed by gzip.
    GzipText,
    /// Text compressed by Zstandard.
    ZstdText,
    /// One JSON object per line.
    JsonLines,
    /// One JSON document: a list of objects, or an object of lists.
    Json,
    /// One NumPy array.
    Npy,
    /// Several NumPy arrays.
    Npz,
    /// MCAP.
    Mcap,
    /// An SQLite file of rosbag2, or a folder of rosbag2 with either storage.
    Rosbag2,
    /// A ROS 1 bag.
    Ros1Bag,
    /// ULog, the log format of PX4.
    Ulog,
    /// Parquet.
    Parquet,
    /// Folder of a LeRobot data set.
    LeRobot,
    /// Folder of a SAGE recording: commands and measurements as text tables.
    Sage,
    /// Arrow, in the file format (Feather) or as a stream.
    Arrow,
    /// DIAdem data, the trace format of KUKA controllers.
    Diadem,
    /// MATLAB, `save -v4`.
    Mat4,
    /// Octave's text format.
    Octave,
    /// MATLAB, `save -v6` and `-v7`.
    Mat5,
    /// HDF5, also written by MATLAB's `save -v7.3`.
    Hdf5,
}

impl FileFormat {
    /// Name of the format in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Text => "text",
            Self::SidewaysText => "text on its side",
            Self::ValueList => "list of values",
            Self::GzipText => "gzip",
            Self::ZstdText => "Zstandard",
            Self::JsonLines => "JSON lines",
            Self::Json => "JSON",
            Self::Npy => "NumPy array",
            Self::Npz => "NumPy archive",
            Self::Mcap => "MCAP",
            Self::Rosbag2 => "rosbag2",
            Self::Ros1Bag => "ROS 1 bag",
            Self::Ulog => "ULog",
            Self::Parquet => "Parquet",
            Self::LeRobot => "LeRobot data set",
            Self::Sage => "SAGE recording",
            Self::Arrow => "Arrow",
            Self::Diadem => "DIAdem data (KUKA trace)",
            Self::Mat4 => "MATLAB 4 file",
            Self::Octave => "Octave text",
            Self::Mat5 => "MATLAB 5 file",
            Self::Hdf5 => "HDF5 file",
        }
    }
}
