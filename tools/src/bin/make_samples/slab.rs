//! A flat slab as a binary STL file, for stackings given by hand.

use glam::Vec3;

/// A box of `size` mm with its lowest corner at the origin.
pub fn slab_stl(size: Vec3) -> Vec<u8> {
    let mut header = [b' '; 80];
    let title = b"lumislice sample: a flat slab, millimetres, z up";
    header[..title.len()].copy_from_slice(title);
    let mut file = header.to_vec();
    file.extend(12u32.to_le_bytes());
    for axis in 0..3 {
        let (u, v) = (Vec3::AXES[(axis + 1) % 3] * size, Vec3::AXES[(axis + 2) % 3] * size);
        let far = Vec3::AXES[axis] * size;
        // The far face runs counter-clockwise seen from outside, the near one the other way.
        let faces =
            [(Vec3::AXES[axis], [far, far + u, far + u + v, far + v]), (-Vec3::AXES[axis], [Vec3::ZERO, v, u + v, u])];
        for (normal, [a, b, c, d]) in faces {
            for triangle in [[a, b, c], [a, c, d]] {
                let numbers = [normal, triangle[0], triangle[1], triangle[2]].map(|v| v.to_array());
                file.extend(numbers.iter().flatten().flat_map(|n| (n + 0.0).to_le_bytes()));
                file.extend(0u16.to_le_bytes());
            }
        }
    }
    file
}
