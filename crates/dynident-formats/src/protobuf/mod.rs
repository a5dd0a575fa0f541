//! Messages of Protocol Buffers: their schemas, as MCAP stores them, and the decoding of their numbers. Encoding:
//! <https://protobuf.dev/programming-guides/encoding/>.

mod decoder;
mod schema;
mod wire;

pub(crate) use decoder::ProtobufDecoder;
