//! One value of an array as a cell.

use arrow_array::cast::AsArray;
use arrow_array::types::{
    ArrowPrimitiveType, Date32Type, Date64Type, DurationMicrosecondType, DurationMillisecondType, DurationNanosecondType,
    DurationSecondType, Float16Type, Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, Time32MillisecondType,
    Time32SecondType, Time64MicrosecondType, Time64NanosecondType, TimestampMicrosecondType, TimestampMillisecondType,
    TimestampNanosecondType, TimestampSecondType, UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, downcast_dictionary_array};
use arrow_schema::{DataType, TimeUnit};
use fusion::source::decode::Cell;

/// A cell without content.
pub(super) const EMPTY: Cell<'static> = Cell::Text(&[]);

/// Nanoseconds of a day.
const DAY: i64 = 86_400_000_000_000;

/// Whether an array of this type has numbers, times or texts.
pub(super) fn is_column(of: &DataType) -> bool {
    use DataType as T;
    match of {
        T::Dictionary(_, values) => is_column(values),
        T::Boolean | T::Utf8 | T::LargeUtf8 | T::Utf8View | T::Float16 | T::Float32 | T::Float64 => true,
        T::Int8 | T::Int16 | T::Int32 | T::Int64 | T::UInt8 | T::UInt16 | T::UInt32 | T::UInt64 => true,
        T::Decimal128(..) => true,
        other => is_time(other),
    }
}

/// Whether its cells are nanoseconds.
pub(super) const fn is_time(of: &DataType) -> bool {
    use DataType as T;
    matches!(
        of,
        T::Timestamp(..) | T::Date32 | T::Date64 | T::Time32(_) | T::Time64(_) | T::Duration(_)
    )
}

/// The value at a place of an array.
pub(super) fn at(array: &dyn Array, k: usize) -> Cell<'_> {
    use DataType as T;
    if array.is_null(k) {
        return EMPTY;
    }
    match array.data_type() {
        T::Float64 => Cell::Number(value::<Float64Type>(array, k)),
        T::Float32 => Cell::Number(value::<Float32Type>(array, k).into()),
        T::Float16 => Cell::Number(value::<Float16Type>(array, k).into()),
        T::Int8 => Cell::Integer(value::<Int8Type>(array, k).into()),
        T::Int16 => Cell::Integer(value::<Int16Type>(array, k).into()),
        T::Int32 => Cell::Integer(value::<Int32Type>(array, k).into()),
        T::Int64 => Cell::Integer(value::<Int64Type>(array, k)),
        T::UInt8 => Cell::Integer(value::<UInt8Type>(array, k).into()),
        T::UInt16 => Cell::Integer(value::<UInt16Type>(array, k).into()),
        T::UInt32 => Cell::Integer(value::<UInt32Type>(array, k).into()),
        T::UInt64 => {
            let number = value::<UInt64Type>(array, k);
            i64::try_from(number).map_or(Cell::Number(number as f64), Cell::Integer)
        }
        T::Boolean => Cell::Integer(array.as_boolean().value(k).into()),
        T::Utf8 => Cell::Text(array.as_string::<i32>().value(k).as_bytes()),
        T::LargeUtf8 => Cell::Text(array.as_string::<i64>().value(k).as_bytes()),
        T::Utf8View => Cell::Text(array.as_string_view().value(k).as_bytes()),
        T::Decimal128(_, scale) => {
            let number = array.as_primitive::<arrow_array::types::Decimal128Type>().value(k);
            Cell::Number(number as f64 / fusion::core::math::powi(10.0, (*scale).into()))
        }
        T::Dictionary(..) => downcast_dictionary_array!(
            array => match array.key(k) {
                Some(key) => at(array.values().as_ref(), key),
                None => EMPTY,
            },
            _ => EMPTY
        ),
        _ => nanoseconds(array, k).map_or(EMPTY, Cell::Integer),
    }
}

fn value<T: ArrowPrimitiveType>(array: &dyn Array, k: usize) -> T::Native {
    array.as_primitive::<T>().value(k)
}

/// A time, a date or a duration in nanoseconds; `None` beyond 292 years.
fn nanoseconds(array: &dyn Array, k: usize) -> Option<i64> {
    use DataType as T;
    use TimeUnit::{Microsecond, Millisecond, Nanosecond, Second};
    let (count, each) = match array.data_type() {
        T::Timestamp(Second, _) => (value::<TimestampSecondType>(array, k), 1_000_000_000),
        T::Timestamp(Millisecond, _) => (value::<TimestampMillisecondType>(array, k), 1_000_000),
        T::Timestamp(Microsecond, _) => (value::<TimestampMicrosecondType>(array, k), 1_000),
        T::Timestamp(Nanosecond, _) => (value::<TimestampNanosecondType>(array, k), 1),
        T::Date32 => (value::<Date32Type>(array, k).into(), DAY),
        T::Date64 => (value::<Date64Type>(array, k), 1_000_000),
        T::Time32(Second) => (value::<Time32SecondType>(array, k).into(), 1_000_000_000),
        T::Time32(_) => (value::<Time32MillisecondType>(array, k).into(), 1_000_000),
        T::Time64(Microsecond) => (value::<Time64MicrosecondType>(array, k), 1_000),
        T::Time64(_) => (value::<Time64NanosecondType>(array, k), 1),
        T::Duration(Second) => (value::<DurationSecondType>(array, k), 1_000_000_000),
        T::Duration(Millisecond) => (value::<DurationMillisecondType>(array, k), 1_000_000),
        T::Duration(Microsecond) => (value::<DurationMicrosecondType>(array, k), 1_000),
        T::Duration(Nanosecond) => (value::<DurationNanosecondType>(array, k), 1),
        _ => return None,
    };
    count.checked_mul(each)
}
