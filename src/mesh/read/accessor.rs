//! glTF accessors: typed views of buffer bytes (glTF 2.0, section 3.6.2).
//!
//! Every range is checked before it is read; an accessor without bytes of its own, whose values are 0 by definition
//! but for those that its sparse part names, may not claim more elements than the file has bytes.

use gltf::accessor::sparse::IndexType;
use gltf::accessor::{DataType, Dimensions};
use gltf::{Accessor, buffer};

use crate::mesh::error::{Fault, Parsed};

/// Elements of an accessor without bytes that a file of any size may have: 1.5 MB of positions from a claim alone.
const FREE_ZEROS: usize = 1 << 16;

/// Whether all its values are 0 for want of bytes.
pub(super) fn is_empty(accessor: &Accessor) -> bool {
    accessor.view().is_none() && accessor.sparse().is_none_or(|sparse| sparse.count() == 0)
}

/// Reads an accessor of vectors with `N` components; normalised integers become fractions.
pub(super) fn vectors<const N: usize>(accessor: &Accessor, buffers: &[Vec<u8>]) -> Parsed<Vec<[f64; N]>> {
    normalised_vectors(accessor, accessor.normalized(), buffers)
}

/// Reads an accessor of colours, with or without alpha, cut to 0 to 1 (glTF 2.0, section 3.7.2.1). Integers are
/// fractions, whether the file says so or forgot to.
pub(super) fn colors(accessor: &Accessor, buffers: &[Vec<u8>]) -> Parsed<Vec<[f32; 3]>> {
    let kept = |c: f64| if c.is_finite() { c.clamp(0.0, 1.0) as f32 } else { 0.0 };
    match accessor.dimensions() {
        Dimensions::Vec4 => {
            let colors = normalised_vectors::<4>(accessor, true, buffers)?;
            Ok(colors.into_iter().map(|[r, g, b, _]| [r, g, b].map(kept)).collect())
        }
        _ => Ok(normalised_vectors::<3>(accessor, true, buffers)?.into_iter().map(|rgb| rgb.map(kept)).collect()),
    }
}

/// Alpha of an accessor of colours, where it has any.
pub(super) fn alphas(accessor: &Accessor, buffers: &[Vec<u8>]) -> Parsed<Option<Vec<f32>>> {
    match accessor.dimensions() {
        Dimensions::Vec4 => {
            let colors = normalised_vectors::<4>(accessor, true, buffers)?;
            Ok(Some(colors.into_iter().map(|[.., alpha]| alpha.clamp(0.0, 1.0) as f32).collect()))
        }
        _ => Ok(None),
    }
}

fn normalised_vectors<const N: usize>(
    accessor: &Accessor,
    normalized: bool,
    buffers: &[Vec<u8>],
) -> Parsed<Vec<[f64; N]>> {
    let place = || format!("accessor {}", accessor.index());
    if accessor.dimensions().multiplicity() != N || matches!(accessor.dimensions(), Dimensions::Mat2) {
        let found = format!("{:?}", accessor.dimensions());
        return Err(Fault::new(place(), found, format!("vectors of {N} components")));
    }
    let layout = Layout { kind: accessor.data_type(), components: N, normalized };
    let count = accessor.count();
    let mut values = match accessor.view() {
        Some(view) => layout.read(&view, accessor.offset(), count, buffers, place)?,
        None if count > FREE_ZEROS.max(buffers.iter().map(Vec::len).sum()) => {
            let found = format!("{count} elements without a buffer view");
            return Err(Fault::new(place(), found, "no more than the file has bytes"));
        }
        None => vec![[0.0; N]; count],
    };
    if let Some(sparse) = accessor.sparse() {
        let kind = match sparse.indices().index_type() {
            IndexType::U8 => DataType::U8,
            IndexType::U16 => DataType::U16,
            IndexType::U32 => DataType::U32,
        };
        let at = Layout { kind, components: 1, normalized: false };
        let (index_source, value_source) = (sparse.indices(), sparse.values());
        let indices: Vec<[f64; 1]> =
            at.read(&index_source.view(), index_source.offset(), sparse.count(), buffers, place)?;
        let replacements: Vec<[f64; N]> =
            layout.read(&value_source.view(), value_source.offset(), sparse.count(), buffers, place)?;
        for ([index], value) in indices.into_iter().zip(replacements) {
            let Some(slot) = values.get_mut(index as usize) else {
                return Err(Fault::new(place(), format!("sparse index {index}"), format!("an index below {count}")));
            };
            *slot = value;
        }
    }
    Ok(values)
}

/// Reads an accessor of unsigned indices.
pub(super) fn indices(accessor: &Accessor, buffers: &[Vec<u8>]) -> Parsed<Vec<u32>> {
    if !matches!(accessor.data_type(), DataType::U8 | DataType::U16 | DataType::U32) {
        let found = format!("indices of type {:?}", accessor.data_type());
        return Err(Fault::new(format!("accessor {}", accessor.index()), found, "unsigned integers"));
    }
    Ok(vectors::<1>(accessor, buffers)?.into_iter().map(|[i]| i as u32).collect())
}

#[derive(Clone, Copy)]
struct Layout {
    kind: DataType,
    components: usize,
    normalized: bool,
}

impl Layout {
    fn read<const N: usize>(
        self,
        view: &buffer::View,
        offset: usize,
        count: usize,
        buffers: &[Vec<u8>],
        place: impl Fn() -> String,
    ) -> Parsed<Vec<[f64; N]>> {
        let component = self.kind.size();
        let element = component * self.components;
        let stride = view.stride().unwrap_or(element);
        let bytes = buffers.get(view.buffer().index()).map_or(&[][..], Vec::as_slice);
        let bytes = view.offset().checked_add(view.length()).and_then(|end| bytes.get(view.offset()..end)).ok_or_else(
            || {
                let found = format!("bytes {} + {} of a buffer of {}", view.offset(), view.length(), bytes.len());
                Fault::new(format!("buffer view {}", view.index()), found, "a range inside the buffer")
            },
        )?;
        if count == 0 {
            return Ok(Vec::new());
        }
        let end =
            stride.checked_mul(count - 1).and_then(|n| n.checked_add(element)).and_then(|n| n.checked_add(offset));
        // A stride of 0 would let one element claim to be any number of them.
        if stride < element || end.is_none_or(|end| end > bytes.len()) {
            let found = format!("{count} elements of {element} bytes, {stride} apart, from byte {offset}");
            return Err(Fault::new(place(), found, format!("elements inside the buffer view's {} bytes", bytes.len())));
        }
        let number = |i: usize| {
            let at = |k: usize| bytes[i + k];
            let value = match self.kind {
                DataType::I8 => f64::from(at(0) as i8),
                DataType::U8 => f64::from(at(0)),
                DataType::I16 => f64::from(i16::from_le_bytes([at(0), at(1)])),
                DataType::U16 => f64::from(u16::from_le_bytes([at(0), at(1)])),
                DataType::U32 => f64::from(u32::from_le_bytes([at(0), at(1), at(2), at(3)])),
                DataType::F32 => f64::from(f32::from_le_bytes([at(0), at(1), at(2), at(3)])),
            };
            match (self.normalized, self.kind) {
                (true, DataType::I8) => (value / 127.0).max(-1.0),
                (true, DataType::U8) => value / 255.0,
                (true, DataType::I16) => (value / 32_767.0).max(-1.0),
                (true, DataType::U16) => value / 65_535.0,
                _ => value,
            }
        };
        let first = |i: usize| offset + i * stride;
        Ok((0..count).map(|i| std::array::from_fn(|c| number(first(i) + c * component))).collect())
    }
}
