//! A study key whose value is a name or a table with settings.

use core::fmt;
use core::marker::PhantomData;
use serde::de::value::{MapAccessDeserializer, MapDeserializer};
use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};

/// Reads an enum tagged by `kind` from a table, or from the name alone.
pub(crate) fn name_or_table<'de, D: Deserializer<'de>, T: Deserialize<'de>>(from: D) -> Result<T, D::Error> {
    struct NameOrTable<T>(PhantomData<T>);
    impl<'de, T: Deserialize<'de>> Visitor<'de> for NameOrTable<T> {
        type Value = T;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a name, or a table with a `kind`")
        }

        fn visit_str<E: serde::de::Error>(self, name: &str) -> Result<T, E> {
            T::deserialize(MapDeserializer::<_, E>::new(core::iter::once(("kind", name.to_owned())))).map_err(E::custom)
        }

        fn visit_map<A: MapAccess<'de>>(self, table: A) -> Result<T, A::Error> {
            T::deserialize(MapAccessDeserializer::new(table)).map_err(A::Error::custom)
        }
    }
    from.deserialize_any(NameOrTable(PhantomData))
}

/// Schema of a key whose value is a name or a table: a string, or the schema of the table.
#[cfg(feature = "schema")]
pub(crate) fn schema(schema: &mut schemars::Schema) {
    let table = core::mem::take(schema.ensure_object());
    let name = schemars::json_schema!({ "type": "string" });
    schema.insert("anyOf".to_owned(), vec![name.to_value(), table.into()].into());
}
