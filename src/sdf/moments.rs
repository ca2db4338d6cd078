//! Area, centroid and second moments of pieces of a surface, and a binary hierarchy of them.

use glam::DVec3;

/// A piece of surface as seen from afar.
#[derive(Debug, Clone, Copy)]
pub struct Moments {
    /// Centroid, mm.
    pub centre: DVec3,
    /// Area, mm².
    pub area: f64,
    /// ∫ (y − centre)(y − centre)ᵀ dA: xx, yy, zz, xy, yz, zx, mm⁴.
    pub second: [f64; 6],
}

impl Moments {
    /// Of a triangle: the second moments are A/12 times the sum over the corners.
    pub fn of_triangle(&[a, b, c]: &[DVec3; 3]) -> Self {
        let area = (b - a).cross(c - a).length() / 2.0;
        let centre = (a + b + c) / 3.0;
        let mut second = [0.0; 6];
        for corner in [a, b, c] {
            add_outer(&mut second, corner - centre, area / 12.0);
        }
        Self { centre, area, second }
    }

    /// Of two pieces together.
    pub fn merge(&self, other: &Self) -> Self {
        let area = self.area + other.area;
        let weight = if area > 0.0 { other.area / area } else { 0.5 };
        let centre = self.centre.lerp(other.centre, weight);
        let mut second: [f64; 6] = std::array::from_fn(|n| self.second[n] + other.second[n]);
        add_outer(&mut second, self.centre - centre, self.area);
        add_outer(&mut second, other.centre - centre, other.area);
        Self { centre, area, second }
    }

    /// Trace of the second moments: area times the mean squared distance from the centroid.
    pub fn trace(&self) -> f64 {
        self.second[0] + self.second[1] + self.second[2]
    }

    /// Root of the mean squared distance from the centroid, mm.
    pub fn spread(&self) -> f64 {
        if self.area > 0.0 { (self.trace() / self.area).sqrt() } else { 0.0 }
    }
}

fn add_outer(second: &mut [f64; 6], v: DVec3, weight: f64) {
    let products = [v.x * v.x, v.y * v.y, v.z * v.z, v.x * v.y, v.y * v.z, v.z * v.x];
    for (sum, product) in second.iter_mut().zip(products) {
        *sum += weight * product;
    }
}

/// Moments of a piece, and how far it extends.
#[derive(Debug, Clone, Copy)]
pub struct Outline {
    /// What it looks like from afar.
    pub moments: Moments,
    /// See [`Moments::spread`].
    pub spread: f64,
    /// All of it is within this of its centroid, mm.
    pub radius: f64,
}

impl Outline {
    /// Of a triangle.
    pub fn of_triangle(corners: &[DVec3; 3]) -> Self {
        let moments = Moments::of_triangle(corners);
        let radius = corners.iter().map(|c| c.distance_squared(moments.centre)).fold(0.0, f64::max).sqrt();
        Self { moments, spread: moments.spread(), radius }
    }

    /// Of two pieces together.
    pub fn merge(&self, other: &Self) -> Self {
        let moments = self.moments.merge(&other.moments);
        let reach = |half: &Self| half.moments.centre.distance(moments.centre) + half.radius;
        Self { moments, spread: moments.spread(), radius: reach(self).max(reach(other)) }
    }
}

/// A node of the hierarchy: one triangle, or two nodes.
#[derive(Debug, Clone, Copy)]
pub struct Node {
    /// How it looks.
    pub outline: Outline,
    /// What it is made of.
    pub content: Content,
}

/// What a node is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Content {
    /// One triangle of the mesh.
    Triangle(u32),
    /// The node after this one and the one at this index.
    Pair(u32),
}

/// Builds the hierarchy over `triangles`, at least one: node 0 is the root, a pair's first node follows it. Halves by
/// the median of centroids along the longer side of their box; the same for the same triangles.
pub fn build_hierarchy(triangles: &[[DVec3; 3]]) -> Vec<Node> {
    let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
    let mut nodes = Vec::with_capacity(2 * triangles.len());
    build(triangles, &mut order, &mut nodes);
    nodes
}

fn build(triangles: &[[DVec3; 3]], order: &mut [u32], nodes: &mut Vec<Node>) {
    let centroid = |t: u32| triangles[t as usize].iter().sum::<DVec3>() / 3.0;
    if let &mut [triangle] = order {
        let outline = Outline::of_triangle(&triangles[triangle as usize]);
        nodes.push(Node { outline, content: Content::Triangle(triangle) });
        return;
    }
    let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (low, high) = order.iter().fold(start, |(low, high), &t| (low.min(centroid(t)), high.max(centroid(t))));
    let axis = (high - low).max_position();
    let middle = order.len() / 2;
    order.select_nth_unstable_by(middle, |&a, &b| centroid(a)[axis].total_cmp(&centroid(b)[axis]).then(a.cmp(&b)));
    let index = nodes.len();
    let (left, right) = order.split_at_mut(middle);
    // Holds the place until both halves are there.
    let outline = Outline::of_triangle(&triangles[left[0] as usize]);
    nodes.push(Node { outline, content: Content::Pair(0) });
    build(triangles, left, nodes);
    let second = nodes.len();
    build(triangles, right, nodes);
    let outline = nodes[index + 1].outline.merge(&nodes[second].outline);
    nodes[index] = Node { outline, content: Content::Pair(second as u32) };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_has_the_moments_of_its_parts() {
        let [a, b, c] = [DVec3::new(0.3, 1.0, -2.0), DVec3::new(4.0, 0.0, 1.0), DVec3::new(-1.0, 2.5, 0.7)];
        let middle = b.lerp(c, 0.37);
        let whole = Moments::of_triangle(&[a, b, c]);
        let parts = Moments::of_triangle(&[a, b, middle]).merge(&Moments::of_triangle(&[a, middle, c]));
        assert!((whole.area - parts.area).abs() < 1e-12);
        assert!(whole.centre.distance(parts.centre) < 1e-12);
        assert!(whole.second.iter().zip(parts.second).all(|(a, b)| (a - b).abs() < 1e-12));
    }
}
