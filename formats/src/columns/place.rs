//! Where the values of a column are in a batch.

use super::cell::{EMPTY, at, is_column, is_time};
use crate::LONGEST_ARRAY;
use arrow_array::cast::AsArray;
use arrow_array::{Array, ArrayRef, RecordBatch};
use arrow_schema::{DataType, Fields};
use fusion::source::decode::Cell;

/// A step from a field to a value inside of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    Field(usize),
    Element(usize),
}

/// A column: its name, and the way to its values.
#[derive(Clone, Debug)]
pub(super) struct Place {
    pub(super) name: String,
    /// Whether its cells are nanoseconds.
    pub(super) is_time: bool,
    field: usize,
    steps: Vec<Step>,
}

/// The columns of a table, and the fields that cannot be columns.
#[derive(Debug, Default)]
pub(super) struct Places {
    pub(super) columns: Vec<Place>,
    pub(super) others: Vec<(String, String)>,
}

impl Places {
    /// The columns of a schema; `first` is its first batch, which shows how long the lists are.
    pub(super) fn of(fields: &Fields, first: Option<&RecordBatch>) -> Self {
        let mut found = Self::default();
        for (k, field) in fields.iter().enumerate() {
            let place = Place {
                name: field.name().clone(),
                is_time: false,
                field: k,
                steps: Vec::new(),
            };
            found.add(place, field.data_type(), first);
        }
        found
    }

    fn add(&mut self, mut place: Place, of: &DataType, first: Option<&RecordBatch>) {
        match of {
            DataType::Struct(fields) => {
                for (k, field) in fields.iter().enumerate() {
                    let inner = place.with(Step::Field(k), &format!(".{}", field.name()));
                    self.add(inner, field.data_type(), first);
                }
            }
            DataType::FixedSizeList(field, _) | DataType::List(field) | DataType::LargeList(field) => {
                let length = match of {
                    DataType::FixedSizeList(_, length) => usize::try_from(*length).unwrap_or_default(),
                    _ => first.and_then(|batch| place.length(batch)).unwrap_or_default(),
                };
                if length > LONGEST_ARRAY {
                    self.others.push((
                        place.name,
                        format!("it has {length} elements, and {LONGEST_ARRAY} at most are read"),
                    ));
                    return;
                }
                for k in 0..length {
                    self.add(place.with(Step::Element(k), &format!("[{k}]")), field.data_type(), first);
                }
            }
            _ if is_column(of) => {
                place.is_time = is_time(of);
                self.columns.push(place);
            }
            other => self.others.push((place.name, format!("values of the type {other} are not read"))),
        }
    }
}

impl Place {
    fn with(&self, step: Step, name: &str) -> Self {
        Self {
            name: format!("{}{name}", self.name),
            steps: self.steps.iter().copied().chain([step]).collect(),
            ..self.clone()
        }
    }

    /// The number of elements in the first row.
    fn length(&self, batch: &RecordBatch) -> Option<usize> {
        let (array, k) = self.inner(batch.column(self.field), 0)?;
        Some(elements(array, k)?.1)
    }

    /// The array of the values, and the place of a row in it.
    fn inner<'a>(&self, mut array: &'a ArrayRef, mut k: usize) -> Option<(&'a ArrayRef, usize)> {
        for step in &self.steps {
            if k >= array.len() || array.is_null(k) {
                return None;
            }
            match step {
                Step::Field(field) => array = array.as_struct_opt()?.columns().get(*field)?,
                Step::Element(element) => {
                    let (start, length) = elements(array, k)?;
                    if *element >= length {
                        return None;
                    }
                    (array, k) = (values(array)?, start + element);
                }
            }
        }
        (k < array.len()).then_some((array, k))
    }

    /// The cell of a row.
    pub(super) fn cell<'a>(&self, batch: &'a RecordBatch, row: usize) -> Cell<'a> {
        self.inner(batch.column(self.field), row)
            .map_or(EMPTY, |(array, k)| at(array.as_ref(), k))
    }
}

/// Where the elements of a list are in the array of all elements: the first one, and their number.
fn elements(array: &ArrayRef, k: usize) -> Option<(usize, usize)> {
    if array.is_null(k) {
        return None;
    }
    let range = |from: i64, to: i64| Some((usize::try_from(from).ok()?, usize::try_from(to - from).ok()?));
    if let Some(list) = array.as_list_opt::<i32>() {
        let offsets = list.value_offsets();
        return range(offsets[k].into(), offsets[k + 1].into());
    }
    if let Some(list) = array.as_list_opt::<i64>() {
        let offsets = list.value_offsets();
        return range(offsets[k], offsets[k + 1]);
    }
    let list = array.as_fixed_size_list_opt()?;
    Some((list.value_offset_at(k), usize::try_from(list.value_length()).ok()?))
}

/// The elements of all lists of an array.
fn values(array: &ArrayRef) -> Option<&ArrayRef> {
    let of_lists = array.as_list_opt::<i32>().map(|list| list.values());
    let of_large = || array.as_list_opt::<i64>().map(|list| list.values());
    of_lists
        .or_else(of_large)
        .or_else(|| array.as_fixed_size_list_opt().map(|list| list.values()))
}
