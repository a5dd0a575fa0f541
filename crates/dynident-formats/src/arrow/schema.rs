//! Arrow schema: which columns are numbers, and the places of their buffers in a batch.

use super::flat::Flat;
use crate::bytes::Number;

const MAX_NESTING: usize = 32;
/// Maximum number of fields, including nested ones; a corrupt schema may refer to one field many times.
const MAX_FIELDS: usize = 1 << 16;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Place {
    /// Index of its node, and of its first buffer, the validity bitmap.
    pub(super) node: usize,
    pub(super) buffer: usize,
    /// Number of view fields before it, whose numbers of buffers are stored in the batch.
    pub(super) views: usize,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Cell {
    Flag,
    Number(Number),
    /// Integers with `per_s` units per second; time stamps are relative to the first one.
    Ticks {
        wide: bool,
        per_s: f64,
        from_first: bool,
    },
}

impl Cell {
    /// Bytes of `count` values; `None` on overflow.
    pub(super) fn bytes(self, count: usize) -> Option<usize> {
        match self {
            Self::Flag => Some(count.div_ceil(8)),
            Self::Number(number) => count.checked_mul(number.size()),
            Self::Ticks { wide, .. } => count.checked_mul(if wide { 8 } else { 4 }),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum List {
    /// Each list is given by the offset of its first entry and that of the next list, of 8 or 4 bytes.
    Offsets { wide: bool },
    /// All lists have this length.
    Fixed(usize),
}

#[derive(Clone, Debug)]
pub(super) struct Leaf {
    pub(super) name: String,
    pub(super) cell: Cell,
    pub(super) around: Vec<Place>,
    pub(super) list: Option<(Place, List)>,
    pub(super) value: Place,
}

#[derive(Debug, Default)]
pub(super) struct Schema {
    pub(super) leaves: Vec<Leaf>,
    pub(super) notes: Vec<String>,
}

enum Kind {
    Cell(Cell),
    List(List),
    Group,
    /// Not numeric: number of buffers after the bitmap, and whether a batch stores a number of further buffers.
    Other {
        buffers: usize,
        views: bool,
    },
    /// Unknown type, so that the buffers of the following fields cannot be found.
    Unknown,
}

fn ticks(unit: i16) -> f64 {
    [1.0, 1e3, 1e6, 1e9][usize::from(unit.clamp(0, 3).unsigned_abs())]
}

/// The type of a field, from Arrow's `Schema.fbs`. `version` is that of the message.
fn kind(field: Flat, version: i16) -> Kind {
    // Dictionary encoding: the buffers contain indices.
    if field.table(4).is_some() {
        return Kind::Other { buffers: 2, views: false };
    }
    let details = field.table(3);
    let byte = |slot| details.map_or(0, |details| details.u8(slot));
    let short = |slot| details.and_then(|details| details.i16(slot));
    let word = |slot| details.map_or(0, |details| details.i32(slot));
    match field.u8(2) {
        // Null; run-end encoding.
        1 | 22 => Kind::Other { buffers: 0, views: false },
        2 => {
            let number = match (word(0), byte(1) != 0) {
                (8, false) => Number::U8,
                (8, true) => Number::I8,
                (16, false) => Number::U16,
                (16, true) => Number::I16,
                (32, false) => Number::U32,
                (32, true) => Number::I32,
                (64, false) => Number::U64,
                (64, true) => Number::I64,
                _ => return Kind::Unknown,
            };
            Kind::Cell(Cell::Number(number))
        }
        3 => match short(0).unwrap_or(0) {
            0 => Kind::Cell(Cell::Number(Number::F16)),
            1 => Kind::Cell(Cell::Number(Number::F32)),
            2 => Kind::Cell(Cell::Number(Number::F64)),
            _ => Kind::Unknown,
        },
        6 => Kind::Cell(Cell::Flag),
        // The default unit of a time stamp is the second, that of a duration and of a time of day the millisecond.
        9 => {
            let wide = match word(1) {
                0 | 32 => false,
                64 => true,
                _ => return Kind::Unknown,
            };
            Kind::Cell(Cell::Ticks { wide, per_s: ticks(short(0).unwrap_or(1)), from_first: false })
        }
        10 => Kind::Cell(Cell::Ticks { wide: true, per_s: ticks(short(0).unwrap_or(0)), from_first: true }),
        18 => Kind::Cell(Cell::Ticks { wide: true, per_s: ticks(short(0).unwrap_or(1)), from_first: false }),
        12 => Kind::List(List::Offsets { wide: false }),
        21 => Kind::List(List::Offsets { wide: true }),
        16 => usize::try_from(word(0)).map_or(Kind::Unknown, |length| Kind::List(List::Fixed(length))),
        13 => Kind::Group,
        // Text and bytes: bitmap, offsets, data. List views: bitmap, offsets, lengths.
        4 | 5 | 19 | 20 | 25 | 26 => Kind::Other { buffers: 3, views: false },
        // Decimals, dates, intervals, bytes of fixed length, maps.
        7 | 8 | 11 | 15 | 17 => Kind::Other { buffers: 2, views: false },
        // Unions, which had a bitmap before version 5: types, and offsets if they are dense.
        14 => Kind::Other { buffers: 1 + usize::from(short(0) == Some(1)) + usize::from(version < 4), views: false },
        // Views of text and bytes.
        23 | 24 => Kind::Other { buffers: 2, views: true },
        _ => Kind::Unknown,
    }
}

/// Visits the fields in the order of their nodes and buffers in a batch.
struct Walk {
    schema: Schema,
    next: Place,
    fields: usize,
    version: i16,
}

impl Schema {
    pub(super) fn read(schema: Flat, version: i16) -> Option<Self> {
        let mut walk = Walk { schema: Self::default(), next: Place::default(), fields: 0, version };
        for field in schema.tables(1) {
            walk.field(field, "", &[], 0)?;
        }
        Some(walk.schema)
    }
}

impl Walk {
    fn field(&mut self, field: Flat, before: &str, around: &[Place], depth: usize) -> Option<()> {
        self.fields += 1;
        if self.fields > MAX_FIELDS || depth > MAX_NESTING {
            return None;
        }
        let name = before.to_owned() + &field.text(0).unwrap_or_default();
        let place = self.next;
        self.next.node += 1;
        match kind(field, self.version) {
            Kind::Cell(cell) => {
                self.next.buffer += 2;
                let around = around.to_vec();
                self.schema.leaves.push(Leaf { name, cell, around, list: None, value: place });
            }
            Kind::Group => {
                self.next.buffer += 1;
                let around: Vec<Place> = around.iter().copied().chain([place]).collect();
                for child in field.tables(5) {
                    self.field(child, &format!("{name}."), &around, depth + 1)?;
                }
            }
            Kind::List(list) => {
                self.next.buffer += if matches!(list, List::Fixed(_)) { 1 } else { 2 };
                let child = field.tables(5).next()?;
                if let (None, Kind::Cell(cell)) = (child.table(4), kind(child, self.version)) {
                    let value = self.next;
                    self.next.node += 1;
                    self.next.buffer += 2;
                    let around = around.to_vec();
                    self.schema.leaves.push(Leaf { name, cell, around, list: Some((place, list)), value });
                } else {
                    self.schema.notes.push(format!("column {name}: lists that are not numeric, or lists of lists"));
                    self.passed(child, depth + 1)?;
                }
            }
            Kind::Other { buffers, views } => {
                self.schema.notes.push(format!("column {name}: not numeric"));
                self.beyond(field, buffers, views, depth)?;
            }
            Kind::Unknown => return None,
        }
        Some(())
    }

    fn passed(&mut self, field: Flat, depth: usize) -> Option<()> {
        self.fields += 1;
        if self.fields > MAX_FIELDS || depth > MAX_NESTING {
            return None;
        }
        self.next.node += 1;
        let (buffers, views) = match kind(field, self.version) {
            Kind::Cell(_) | Kind::List(List::Offsets { .. }) => (2, false),
            Kind::Group | Kind::List(List::Fixed(_)) => (1, false),
            Kind::Other { buffers, views } => (buffers, views),
            Kind::Unknown => return None,
        };
        self.beyond(field, buffers, views, depth)
    }

    /// Skips the buffers of a field and its children; the values of a dictionary are in separate batches.
    fn beyond(&mut self, field: Flat, buffers: usize, views: bool, depth: usize) -> Option<()> {
        self.next.buffer += buffers;
        self.next.views += usize::from(views);
        if field.table(4).is_none() {
            for child in field.tables(5) {
                self.passed(child, depth + 1)?;
            }
        }
        Some(())
    }
}
