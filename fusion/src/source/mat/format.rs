//! MAT-files, version 5: arrays of numbers by name, those within structures too.
//!
//! ```text
//! header (128 bytes) | element | element | …        element: tag (type, bytes) | data | padding to 8 bytes
//! matrix: flags | dimensions | name | numbers       compressed: a matrix within a zlib stream
//! ```
//!
//! Source    MathWorks, MAT-File Format (2024), chapter 1: level 5
//! Not here  complex and sparse arrays, text, cells, arrays of structures, objects: named by their kind and
//!           left out; files of version 4, and files of version 7.3, which are HDF5

use flate2::read::ZlibDecoder;
use std::io::Read;

/// An array of a file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Variable {
    /// Its name, with the names of the structures around it: `imu.acc`.
    pub(super) name: String,
    /// Its dimensions, two at least.
    pub(super) shape: Vec<usize>,
    pub(super) content: Content,
}

impl Variable {
    /// Its dimensions, such as `5×3`.
    pub(super) fn shape(&self) -> String {
        let sizes: Vec<String> = self.shape.iter().map(ToString::to_string).collect();
        sizes.join("×")
    }
}

/// The content of an array; the first index changes fastest.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Content {
    Numbers(Vec<f64>),
    /// Whole numbers, exact.
    Integers(Vec<i64>),
    /// Not numbers; the text names the kind.
    Other(&'static str),
}

/// The largest number of bytes of a file, and of all its arrays unpacked.
pub(super) const MOST: u64 = 1 << 30;

/// The message for a larger file.
pub(super) fn too_large() -> String {
    format!(
        "this file has more than {} GiB: split it, or save the arrays that are needed alone",
        MOST >> 30
    )
}

/// Levels of structures within structures.
const DEPTH: usize = 32;

const HEADER: usize = 128;
const COMPRESSED: u32 = 15;
const MATRIX: u32 = 14;

// Classes of arrays; 6 to 15 are numbers: double, single, then the integers.
const STRUCTURE: u32 = 2;
/// Objects of classes: they have no dimensions here.
const OPAQUE: u32 = 17;

/// All arrays of a file, in its order.
///
/// # Errors
/// The mistake in the file, and its place.
pub(super) fn variables(file: &[u8]) -> Result<Vec<Variable>, String> {
    let is_big = is_big_endian(file)?;
    let mut rest = Bytes {
        bytes: file.get(HEADER..).unwrap_or_default(),
        is_big,
    };
    let (mut found, mut left) = (Vec::new(), MOST);
    while !rest.bytes.is_empty() {
        let at = file.len() - rest.bytes.len();
        let placed = |what: String| format!("byte {at}: {what}");
        let (kind, data) = rest.element().map_err(placed)?;
        match kind {
            COMPRESSED => {
                let mut unpacked = Vec::new();
                let inflated = ZlibDecoder::new(data.bytes).take(left + 1).read_to_end(&mut unpacked);
                inflated.map_err(|error| placed(format!("a compressed array is damaged: {error}")))?;
                left = left.checked_sub(unpacked.len() as u64).ok_or_else(|| placed(too_large()))?;
                let mut inner = Bytes { bytes: &unpacked, is_big };
                if let (MATRIX, data) = inner.element().map_err(placed)? {
                    data.matrix(None, 0, &mut found).map_err(placed)?;
                }
            }
            MATRIX => data.matrix(None, 0, &mut found).map_err(placed)?,
            _ => {}
        }
    }
    Ok(found)
}

/// The byte order, which the header states.
fn is_big_endian(file: &[u8]) -> Result<bool, String> {
    if file.get(..10).is_some_and(|text| text == b"MATLAB 7.3") {
        return Err("this file was saved with `-v7.3`, as HDF5: save it with `-v7`".to_owned());
    }
    match file.get(HEADER - 4..HEADER) {
        Some([_, 1, b'I', b'M']) => Ok(false),
        Some([1, _, b'M', b'I']) => Ok(true),
        _ => Err("this is no MAT-file of version 5: save it with `-v7`".to_owned()),
    }
}

/// A part of a file.
#[derive(Clone, Copy)]
struct Bytes<'a> {
    bytes: &'a [u8],
    is_big: bool,
}

const CUT_OFF: &str = "the file is cut off here";

impl<'a> Bytes<'a> {
    /// The next bytes.
    fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let (taken, rest) = self.bytes.split_at_checked(count).ok_or(CUT_OFF)?;
        self.bytes = rest;
        Ok(taken)
    }

    fn whole(&mut self) -> Result<u32, String> {
        let bytes = *self.take(4)?.first_chunk().ok_or(CUT_OFF)?;
        Ok(if self.is_big {
            u32::from_be_bytes(bytes)
        } else {
            u32::from_le_bytes(bytes)
        })
    }

    /// The type of the next element and its data.
    fn element(&mut self) -> Result<(u32, Self), String> {
        let tag = self.whole()?;
        let is_big = self.is_big;
        let part = |bytes| Self { bytes, is_big };
        if tag >> 16 != 0 {
            // Up to four bytes are in the tag itself.
            let data = part(self.take(4)?);
            let data = data
                .bytes
                .get(..(tag >> 16) as usize)
                .ok_or("a short element is longer than four bytes")?;
            return Ok((tag & 0xffff, part(data)));
        }
        let count = self.whole()? as usize;
        let data = self.take(count)?;
        let padding = if tag == COMPRESSED { 0 } else { count.next_multiple_of(8) - count };
        // The last element of a file may lack it.
        self.bytes = self.bytes.get(padding..).unwrap_or_default();
        Ok((tag, part(data)))
    }

    /// A matrix and all within it.
    fn matrix(mut self, within: Option<&str>, depth: usize, found: &mut Vec<Variable>) -> Result<(), String> {
        if self.bytes.is_empty() {
            // An empty field of a structure.
            return Ok(());
        }
        let mut flags = self.element()?.1;
        let flags = flags.whole()?;
        let (class, is_complex) = (flags & 0xff, flags & 0x800 != 0);
        let shape = if class == OPAQUE { Vec::new() } else { self.shape()? };
        let own = self.text()?;
        let name = within.map_or_else(|| own.clone(), str::to_owned);
        if name.is_empty() {
            // The data of objects, which have no name.
            return Ok(());
        }
        let count = shape.iter().try_fold(1_usize, |n, k| n.checked_mul(*k));
        let count = count.ok_or_else(|| format!("`{name}` has more elements than there can be"))?;
        let content = match class {
            STRUCTURE if count == 1 => return self.fields(&name, depth, found),
            6..=15 if is_complex => Content::Other("an array of complex numbers"),
            6..=15 => self.array(class, count).map_err(|what| format!("`{name}`: {what}"))?,
            1 => Content::Other("a cell array"),
            STRUCTURE => Content::Other("an array of structures"),
            4 => Content::Other("text"),
            5 => Content::Other("a sparse array"),
            _ => Content::Other("an object, such as a table or a datetime"),
        };
        found.push(Variable { name, shape, content });
        Ok(())
    }

    fn shape(&mut self) -> Result<Vec<usize>, String> {
        let (kind, data) = self.element()?;
        let shape = data.whole_numbers(kind)?;
        let shape: Option<Vec<usize>> = shape.into_iter().map(|k| usize::try_from(k).ok()).collect();
        shape
            .filter(|shape| shape.len() >= 2)
            .ok_or_else(|| "the dimensions of an array are damaged".to_owned())
    }

    fn text(&mut self) -> Result<String, String> {
        Ok(String::from_utf8_lossy(self.element()?.1.bytes).trim_end_matches('\0').to_owned())
    }

    /// The fields of a structure.
    fn fields(mut self, of: &str, depth: usize, found: &mut Vec<Variable>) -> Result<(), String> {
        if depth == DEPTH {
            return Err(format!("`{of}`: structures are nested more than {DEPTH} deep"));
        }
        let length = self.element()?.1.whole()? as usize;
        let names = self.element()?.1.bytes;
        if length == 0 {
            return Ok(());
        }
        for name in names.chunks(length) {
            let name = String::from_utf8_lossy(name);
            let name = format!("{of}.{}", name.split('\0').next().unwrap_or_default());
            let (MATRIX, data) = self.element()? else {
                return Err(format!("`{name}` is no array"));
            };
            data.matrix(Some(&name), depth + 1, found)?;
        }
        Ok(())
    }

    /// The elements of an array, stored in any type that holds them.
    fn array(&mut self, class: u32, count: usize) -> Result<Content, String> {
        let (kind, data) = self.element()?;
        let content = match kind {
            7 => Content::Numbers(data.each(f32::from_le_bytes, f32::from_be_bytes, f64::from)),
            9 => Content::Numbers(data.each(f64::from_le_bytes, f64::from_be_bytes, |v| v)),
            _ => {
                let whole = data.whole_numbers(kind)?;
                let exact: Option<Vec<i64>> = whole.iter().map(|v| i64::try_from(*v).ok()).collect();
                match exact.filter(|_| class > 7) {
                    Some(exact) => Content::Integers(exact),
                    None => Content::Numbers(whole.into_iter().map(|v| v as f64).collect()),
                }
            }
        };
        let length = match &content {
            Content::Numbers(numbers) => numbers.len(),
            Content::Integers(numbers) => numbers.len(),
            Content::Other(_) => count,
        };
        if length == count {
            Ok(content)
        } else {
            Err(format!("the array has {length} elements, and its dimensions ask for {count}"))
        }
    }

    fn whole_numbers(self, kind: u32) -> Result<Vec<i128>, String> {
        Ok(match kind {
            1 => self.each(i8::from_le_bytes, i8::from_be_bytes, i128::from),
            2 => self.each(u8::from_le_bytes, u8::from_be_bytes, i128::from),
            3 => self.each(i16::from_le_bytes, i16::from_be_bytes, i128::from),
            4 => self.each(u16::from_le_bytes, u16::from_be_bytes, i128::from),
            5 => self.each(i32::from_le_bytes, i32::from_be_bytes, i128::from),
            6 => self.each(u32::from_le_bytes, u32::from_be_bytes, i128::from),
            12 => self.each(i64::from_le_bytes, i64::from_be_bytes, i128::from),
            13 => self.each(u64::from_le_bytes, u64::from_be_bytes, i128::from),
            _ => return Err(format!("numbers of the unknown type {kind}")),
        })
    }

    /// All numbers, converted.
    fn each<const N: usize, T, V>(self, little: fn([u8; N]) -> T, big: fn([u8; N]) -> T, convert: fn(T) -> V) -> Vec<V> {
        let read = if self.is_big { big } else { little };
        self.bytes.as_chunks().0.iter().map(|bytes| convert(read(*bytes))).collect()
    }
}
