//! Files that are no text tables, known by their first bytes, so that a message can say what they are and what to do.

/// A format of recordings that is not read.
pub(super) struct Foreign {
    /// What a file of it begins with.
    begins: &'static [u8],
    /// What it is.
    pub(super) format: &'static str,
    /// How to make a text table of it.
    pub(super) fix: &'static str,
}

/// How a table in a program becomes a text table.
const EXPORT: &str = "export its table as CSV (pandas: `frame.to_csv(\"log.csv\", index=False)`)";
const UNPACK: &str = "unpack it first";
const ROS: &str = "export the joint states as CSV, one row for each message (`ros2 topic echo --csv /joint_states`, PlotJuggler, \
     or rosbags in Python)";

const FORMATS: [Foreign; 16] = [
    Foreign { begins: b"\x89MCAP0\r\n", format: "an MCAP recording (ROS 2 bag, Foxglove)", fix: ROS },
    Foreign { begins: b"#ROSBAG V", format: "a ROS 1 bag", fix: ROS },
    Foreign { begins: b"SQLite format 3\0", format: "an SQLite database (an older ROS 2 bag?)", fix: ROS },
    Foreign { begins: b"\x89HDF\r\n", format: "an HDF5 file (MATLAB 7.3, pandas)", fix: EXPORT },
    Foreign { begins: b"MATLAB 5.0 MAT-file", format: "a MATLAB file", fix: "write its arrays with `writetable`" },
    Foreign {
        begins: b"\x93NUMPY",
        format: "a NumPy array",
        fix: "write it with `numpy.savetxt(.., delimiter=\",\")`",
    },
    Foreign { begins: b"PAR1", format: "a Parquet table", fix: EXPORT },
    Foreign { begins: b"ARROW1", format: "an Arrow (Feather) table", fix: EXPORT },
    Foreign {
        begins: b"PK\x03\x04",
        format: "a ZIP archive (a workbook or a NumPy .npz is one, too)",
        fix: "unpack it, or save the workbook's sheet as CSV",
    },
    Foreign { begins: b"\x1F\x8B", format: "a gzip archive", fix: UNPACK },
    Foreign { begins: b"\x28\xB5\x2F\xFD", format: "a Zstandard archive", fix: UNPACK },
    Foreign { begins: b"BZh", format: "a bzip2 archive", fix: UNPACK },
    Foreign { begins: b"\xFD7zXZ\0", format: "an xz archive", fix: UNPACK },
    Foreign { begins: b"\xFF\xFE", format: "text in UTF-16", fix: "save it as UTF-8" },
    Foreign { begins: b"\xFE\xFF", format: "text in UTF-16", fix: "save it as UTF-8" },
    Foreign { begins: b"<?xml", format: "an XML document", fix: EXPORT },
];

/// The format that a file with this beginning has, if it is one of those known.
pub(super) fn recognised(beginning: &[u8]) -> Option<&'static Foreign> {
    FORMATS.iter().find(|format| beginning.starts_with(format.begins))
}
