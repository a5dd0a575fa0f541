//! Compressed text as a stream.

use crate::error::FileError;
use crate::kind::FileFormat;
use std::io::Read;
use std::path::Path;

/// The decompressed bytes of `reader`; several compressed parts one after another are all read.
pub(crate) fn unpacked(
    path: &Path,
    format: FileFormat,
    reader: impl std::io::BufRead + Send + 'static,
) -> Result<Box<dyn Read + Send>, FileError> {
    match format {
        #[cfg(feature = "gzip")]
        FileFormat::GzipText => Ok(Box::new(flate2::bufread::MultiGzDecoder::new(reader))),
        #[cfg(feature = "zstd")]
        FileFormat::ZstdText => {
            let mut decoder = zstd::stream::read::Decoder::with_buffer(reader)
                .map_err(|source| FileError::Io { file: path.to_owned(), source })?;
            // 2^27 bytes = 128 MiB, the default limit of the program `zstd`.
            decoder.window_log_max(27).map_err(|source| FileError::Io { file: path.to_owned(), source })?;
            Ok(Box::new(decoder))
        }
        _ => Err(FileError::NotBuilt {
            file: path.to_owned(),
            format: format.name(),
            feature: if format == FileFormat::GzipText { "gzip" } else { "zstd" },
        }),
    }
}
