//! The catalogue of printed cartons.

/// A kind of printed carton: an index into the catalogue.
///
/// ```
/// use yarp_table::BrickKind;
///
/// let milk = BrickKind::from_name("milk").unwrap();
/// assert_eq!(milk.size(), [0.095, 0.165, 0.063]);
/// assert_eq!(BrickKind::all().count(), 8);
/// ```
#[derive(Clone, Copy, Debug, Eq, Hash, Ord, PartialEq, PartialOrd)]
pub struct BrickKind(usize);

struct Row {
    name: &'static str,
    /// Title printed on it.
    title: &'static str,
    /// x, y, z in m: y the longest, z the shortest.
    size: [f64; 3],
    /// kg, full.
    mass: f64,
    /// Background and print, sRGB.
    colours: [[u8; 3]; 4],
}

/// Edges of a carton of 1 l, of a slim one, and of one of 0.2 l (catalogue values).
const LITRE: [f64; 3] = [0.095, 0.165, 0.063];
const SLIM: [f64; 3] = [0.070, 0.195, 0.070];
const SMALL: [f64; 3] = [0.048, 0.115, 0.038];

const CATALOGUE: [Row; 8] = [
    row(
        "milk",
        "MILK",
        LITRE,
        1.05,
        [[240, 244, 250], [30, 90, 190], [220, 40, 50], [20, 40, 90]],
    ),
    row(
        "orange",
        "ORANGE",
        LITRE,
        1.05,
        [[250, 180, 40], [230, 100, 20], [40, 120, 40], [120, 40, 10]],
    ),
    row(
        "tomato",
        "TOMATO",
        LITRE,
        1.05,
        [[200, 40, 30], [250, 230, 200], [40, 130, 60], [90, 10, 10]],
    ),
    row(
        "rice",
        "RICE",
        SLIM,
        0.98,
        [[235, 225, 190], [120, 160, 60], [150, 90, 40], [60, 60, 30]],
    ),
    row(
        "apple",
        "APPLE",
        SLIM,
        0.98,
        [[170, 210, 90], [60, 130, 40], [220, 60, 50], [30, 70, 20]],
    ),
    row(
        "grape",
        "GRAPE",
        SMALL,
        0.22,
        [[120, 60, 140], [230, 210, 240], [70, 140, 60], [50, 20, 70]],
    ),
    row(
        "cocoa",
        "COCOA",
        SMALL,
        0.22,
        [[120, 75, 45], [240, 215, 170], [220, 160, 50], [50, 28, 15]],
    ),
    row(
        "peach",
        "PEACH",
        SMALL,
        0.22,
        [
            [250, 205, 165],
            [240, 120, 80],
            [60, 150, 120],
            [150, 60, 40],
        ],
    ),
];

const fn row(
    name: &'static str,
    title: &'static str,
    size: [f64; 3],
    mass: f64,
    colours: [[u8; 3]; 4],
) -> Row {
    Row {
        name,
        title,
        size,
        mass,
        colours,
    }
}

impl BrickKind {
    /// Returns every kind of the catalogue.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..CATALOGUE.len()).map(Self)
    }

    /// Returns the kind of this name.
    pub fn from_name(name: &str) -> Option<Self> {
        CATALOGUE.iter().position(|row| row.name == name).map(Self)
    }

    /// Returns its place in the catalogue, from 0.
    pub const fn index(self) -> usize {
        self.0
    }

    /// Returns its name.
    pub const fn name(self) -> &'static str {
        CATALOGUE[self.0].name
    }

    /// Returns its edges along x, y and z, m: y the longest, z the shortest.
    pub const fn size(self) -> [f64; 3] {
        CATALOGUE[self.0].size
    }

    /// Returns its mass when full, kg.
    pub const fn mass(self) -> f64 {
        CATALOGUE[self.0].mass
    }

    /// Returns the title printed on it.
    pub(crate) const fn title(self) -> &'static str {
        CATALOGUE[self.0].title
    }

    /// Returns background and print colours, sRGB.
    pub(crate) const fn colours(self) -> [[u8; 3]; 4] {
        CATALOGUE[self.0].colours
    }
}

/// A face of a carton.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub enum Face {
    /// Toward +z: the large face that is up while the carton lies.
    Front,
    /// Toward -z.
    Back,
    /// Toward +x.
    Right,
    /// Toward -x.
    Left,
    /// Toward +y: the top while the carton stands.
    Top,
    /// Toward -y.
    Bottom,
}

impl Face {
    /// All faces.
    pub const ALL: [Self; 6] = [
        Self::Front,
        Self::Back,
        Self::Right,
        Self::Left,
        Self::Top,
        Self::Bottom,
    ];

    /// Returns the word for it in file names.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Front => "front",
            Self::Back => "back",
            Self::Right => "right",
            Self::Left => "left",
            Self::Top => "top",
            Self::Bottom => "bottom",
        }
    }

    /// Returns the axes of the face in the carton's frame as columns of its image (left to right), rows (top to bottom) and
    /// outward normal; the last is the cross product of rows and columns.
    pub const fn axes(self) -> [[f64; 3]; 3] {
        const X: [f64; 3] = [1.0, 0.0, 0.0];
        const Y: [f64; 3] = [0.0, 1.0, 0.0];
        const Z: [f64; 3] = [0.0, 0.0, 1.0];
        const NX: [f64; 3] = [-1.0, 0.0, 0.0];
        const NY: [f64; 3] = [0.0, -1.0, 0.0];
        const NZ: [f64; 3] = [0.0, 0.0, -1.0];
        // Seen from outside: normal = columns x (up) = columns x -rows.
        match self {
            Self::Front => [X, NY, Z],
            Self::Back => [NX, NY, NZ],
            Self::Right => [NZ, NY, X],
            Self::Left => [Z, NY, NX],
            Self::Top => [X, Z, Y],
            Self::Bottom => [X, NZ, NY],
        }
    }

    /// Returns width and height of this face of a cuboid of these edges, m.
    pub fn size(self, edges: [f64; 3]) -> [f64; 2] {
        let [columns, rows, _] = self.axes();
        let along = |axis: [f64; 3]| -> f64 {
            axis.iter().zip(edges).map(|(a, edge)| a.abs() * edge).sum()
        };
        [along(columns), along(rows)]
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn faces_are_seen_from_outside_and_not_mirrored() {
        for face in Face::ALL {
            let [columns, rows, normal] = face.axes().map(Vector3::from);
            assert_eq!(columns.cross(&-rows), normal, "{face:?}");
        }
    }

    #[test]
    fn the_longest_edge_is_along_y_and_the_shortest_along_z() {
        for kind in BrickKind::all() {
            let [x, y, z] = kind.size();
            assert!(y >= x && x >= z, "{}", kind.name());
            assert_eq!(BrickKind::from_name(kind.name()), Some(kind));
        }
    }
}
