//! NumPy's `.npy` files: the header, and values as `f32`.
//!
//! Format version 1.0 to 3.0 of `numpy.lib.format`: six bytes of magic, version, length of a header that is the literal
//! of a Python dictionary with `descr`, `fortran_order` and `shape`, then the values. Read here are C-ordered arrays of
//! `f2`, `f4`, `f8`, `u1` and `b1` in either byte order: everything a response can sensibly be stored as.

use std::io::{self, Read};

use half::{f16, slice::HalfFloatSliceExt};

/// How values are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Element {
    /// Half precision.
    F16,
    /// Single precision.
    F32,
    /// Double precision.
    F64,
    /// A byte, or a boolean.
    U8,
}

impl Element {
    /// Bytes per value.
    pub fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::F16 => 2,
            Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

/// What the header of an array says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NpyHeader {
    /// Type of the values.
    pub element: Element,
    /// Whether they are big-endian.
    pub big_endian: bool,
    /// Length per axis, the last running fastest.
    pub shape: Vec<usize>,
    /// Bytes before the first value.
    pub start: u64,
}

/// Longest header accepted: NumPy's own writes 118 bytes.
const MAX_HEADER: usize = 1 << 16;
const MAGIC: &[u8] = b"\x93NUMPY";

/// What stands in the way of reading an array.
#[derive(Debug, thiserror::Error)]
pub enum NpyError {
    /// The system's complaint.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// Not what is read here.
    #[error("found {found}, expected {expected}")]
    Format {
        /// What the file says.
        found: String,
        /// What it should say.
        expected: &'static str,
    },
}

impl crate::blame::Blamed for NpyError {}

fn fault(found: impl Into<String>, expected: &'static str) -> NpyError {
    NpyError::Format { found: found.into(), expected }
}

impl NpyHeader {
    /// Reads the header; the values follow in `input`.
    ///
    /// # Errors
    /// [`NpyError::Format`] for what is no array, or one of another kind; the system's own.
    pub fn read(input: &mut impl Read) -> Result<Self, NpyError> {
        let mut begin = [0; 8];
        input.read_exact(&mut begin).map_err(short)?;
        if &begin[..6] != MAGIC {
            return Err(fault("no NumPy array", "a .npy file"));
        }
        let (length, before) = match begin[6] {
            1 => {
                let mut bytes = [0; 2];
                input.read_exact(&mut bytes).map_err(short)?;
                (usize::from(u16::from_le_bytes(bytes)), 10)
            }
            2 | 3 => {
                let mut bytes = [0; 4];
                input.read_exact(&mut bytes).map_err(short)?;
                (u32::from_le_bytes(bytes) as usize, 12)
            }
            version => return Err(fault(format!(".npy version {version}"), "version 1, 2 or 3")),
        };
        if length > MAX_HEADER {
            return Err(fault(format!("a header of {length} bytes"), "at most 65536 bytes"));
        }
        let mut text = vec![0; length];
        input.read_exact(&mut text).map_err(short)?;
        let text = String::from_utf8_lossy(&text);
        let descr = quoted(after(&text, "descr")?)?;
        let (big_endian, element) = match descr.split_at_checked(1) {
            Some((order, kind)) => (order == ">", kind),
            None => (false, ""),
        };
        let element = match element {
            "f2" => Element::F16,
            "f4" => Element::F32,
            "f8" => Element::F64,
            "u1" | "b1" => Element::U8,
            _ => {
                let found = format!("values of type {}", crate::words::excerpt(descr));
                return Err(fault(found, "float16, float32, float64, uint8 or bool"));
            }
        };
        if !after(&text, "fortran_order")?.starts_with("False") {
            return Err(fault("an array in Fortran order", "C order: numpy.ascontiguousarray"));
        }
        let shape = after(&text, "shape")?;
        let inner = shape.strip_prefix('(').and_then(|rest| rest.split_once(')')).map(|(inner, _)| inner);
        let axes = inner.unwrap_or("?").split(',').map(str::trim).filter(|axis| !axis.is_empty());
        let shape: Result<Vec<usize>, _> = axes.map(str::parse).collect();
        let shape = shape.map_err(|_| fault(format!("shape {inner:?}"), "a tuple of lengths"))?;
        if shape.iter().try_fold(element.bytes(), |bytes, axis| bytes.checked_mul(*axis)).is_none() {
            return Err(fault(format!("shape {shape:?}"), "an array that a file can hold"));
        }
        Ok(Self { element, big_endian, shape, start: (before + length) as u64 })
    }

    /// Bytes of all values.
    pub fn value_bytes(&self) -> u64 {
        self.shape.iter().map(|axis| *axis as u64).product::<u64>() * self.element.bytes() as u64
    }

    /// Decodes values; `bytes` holds as many as `out`.
    pub fn decode(&self, bytes: &[u8], out: &mut [f32]) {
        match (self.element, self.big_endian) {
            (Element::U8, _) => out.iter_mut().zip(bytes).for_each(|(out, byte)| *out = f32::from(*byte)),
            (Element::F16, false) => halves(bytes, out, f16::from_le_bytes),
            (Element::F16, true) => halves(bytes, out, f16::from_be_bytes),
            (Element::F32, false) => each(bytes, out, f32::from_le_bytes),
            (Element::F32, true) => each(bytes, out, f32::from_be_bytes),
            (Element::F64, false) => each(bytes, out, |b| f64::from_le_bytes(b) as f32),
            (Element::F64, true) => each(bytes, out, |b| f64::from_be_bytes(b) as f32),
        }
    }
}

fn each<const N: usize>(bytes: &[u8], out: &mut [f32], value: impl Fn([u8; N]) -> f32) {
    let (values, _) = bytes.as_chunks::<N>();
    out.iter_mut().zip(values).for_each(|(out, bytes)| *out = value(*bytes));
}

/// Half precision, many at a time: one by one each asks anew what the processor can do.
fn halves(bytes: &[u8], out: &mut [f32], value: impl Fn([u8; 2]) -> f16) {
    let mut buffer = [f16::ZERO; 256];
    for (out, bytes) in out.chunks_mut(buffer.len()).zip(bytes.chunks(2 * buffer.len())) {
        let halves = &mut buffer[..out.len()];
        halves.iter_mut().zip(bytes.as_chunks::<2>().0).for_each(|(half, bytes)| *half = value(*bytes));
        halves.convert_to_f32_slice(out);
    }
}

/// A file that ends too early is no disk error.
fn short(error: io::Error) -> NpyError {
    if error.kind() == io::ErrorKind::UnexpectedEof {
        fault("a file that ends in its header", "a .npy file")
    } else {
        NpyError::Io(error)
    }
}

/// What follows a key of the dictionary.
fn after<'a>(text: &'a str, key: &str) -> Result<&'a str, NpyError> {
    let place = ['\'', '"'].iter().find_map(|quote| text.split_once(&format!("{quote}{key}{quote}:")));
    match place {
        Some((_, rest)) => Ok(rest.trim_start()),
        None => Err(fault(format!("a header without {key}"), "a .npy file")),
    }
}

fn quoted(text: &str) -> Result<&str, NpyError> {
    let quote = text.chars().next().filter(|c| ['\'', '"'].contains(c));
    let inner = quote.and_then(|quote| text[1..].split_once(quote));
    inner.map(|(inner, _)| inner).ok_or_else(|| fault("a structured array", "an array of plain numbers"))
}

/// A `.npy` file of `f32` in C order.
pub fn write_npy(shape: &[usize], values: &[f32]) -> Vec<u8> {
    let axes: String = shape.iter().map(|axis| format!("{axis}, ")).collect();
    // A tuple of one has its comma, longer ones need none.
    let axes = if shape.len() == 1 { axes.trim_end() } else { axes.trim_end_matches(", ") };
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({axes}), }}");
    let length = (MAGIC.len() + 4 + header.len() + 1).next_multiple_of(64) - MAGIC.len() - 4;
    header += &" ".repeat(length - 1 - header.len());
    header.push('\n');
    let mut file = Vec::with_capacity(10 + length + 4 * values.len());
    file.extend_from_slice(MAGIC);
    file.extend([1, 0]);
    file.extend((length as u16).to_le_bytes()); // at most some hundred bytes
    file.extend_from_slice(header.as_bytes());
    file.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    file
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(text: &str) -> Vec<u8> {
        let mut file = MAGIC.to_vec();
        file.extend([1, 0]);
        file.extend((text.len() as u16).to_le_bytes());
        file.extend(text.as_bytes());
        file
    }

    #[test]
    fn what_is_written_is_read() {
        let values = [1.0, -2.5, f32::NAN, 1e-30];
        for shape in [vec![4], vec![2, 2], vec![1, 2, 1, 2]] {
            let file = write_npy(&shape, &values);
            let found = NpyHeader::read(&mut file.as_slice()).unwrap();
            assert_eq!((found.element, &found.shape, found.start % 64), (Element::F32, &shape, 0));
            let mut out = [0.0; 4];
            found.decode(&file[found.start as usize..], &mut out);
            assert!(out.iter().zip(values).all(|(a, b)| a.to_bits() == b.to_bits()));
        }
    }

    #[test]
    fn every_type_and_order_gives_the_same_numbers() {
        // 1.5 and −2 are exact in all of them.
        let cases: [(&str, Vec<u8>); 5] = [
            ("<f2", vec![0, 0x3e, 0, 0xc0]),
            (">f2", vec![0x3e, 0, 0xc0, 0]),
            (">f4", [1.5f32, -2.0].iter().flat_map(|v| v.to_be_bytes()).collect()),
            ("<f8", [1.5f64, -2.0].iter().flat_map(|v| v.to_le_bytes()).collect()),
            (">f8", [1.5f64, -2.0].iter().flat_map(|v| v.to_be_bytes()).collect()),
        ];
        for (descr, bytes) in cases {
            let file = header(&format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': (2,), }}"));
            let found = NpyHeader::read(&mut file.as_slice()).unwrap();
            let mut out = [0.0; 2];
            found.decode(&bytes, &mut out);
            assert_eq!(out, [1.5, -2.0], "{descr}");
        }
    }

    #[test]
    fn what_is_no_array_is_refused() {
        let cases: [(&[u8], &str); 8] = [
            (b"", "ends in its header"),
            (b"PK\x03\x04aaaaaaaaaa", "no NumPy array"),
            (b"\x93NUMPY\x09\x00\x10\x00", "version 9"),
            (&header("{'descr': '<i4', 'fortran_order': False, 'shape': (2,)}"), "type <i4"),
            (&header("{'descr': '<\n', 'fortran_order': False, 'shape': (2,)}"), "type <\\n,"),
            (&header("{'descr': '<f4', 'fortran_order': True, 'shape': (2,)}"), "Fortran"),
            (&header("{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (2,)}"), "structured"),
            (&header("{'descr': '<f4', 'fortran_order': False, 'shape': (9999999999, 9999999999)}"), "shape"),
        ];
        for (file, part) in cases {
            let error = NpyHeader::read(&mut &file[..]).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
    }
}
