//! Things on the table: shape, size, mass, friction and colour.

use std::fmt;

use crate::Pose;
use crate::bricks::BrickKind;

/// The class of an object, as a recogniser names it.
#[derive(Clone, Copy, Debug, Eq, Hash, Ord, PartialEq, PartialOrd)]
pub enum Class {
    /// A tumbler: a small cylinder, open at the top.
    Glass,
    /// A plate: a large flat cylinder.
    Plate,
    /// A box of plain colour.
    Box,
    /// A box with a triangular base.
    Prism,
    /// A printed beverage carton, which texture tells apart.
    Brick,
    /// A calibration board.
    Board,
    /// Something that nobody looks for: paper, cutlery, pens.
    Clutter,
}

impl Class {
    /// All classes.
    pub const ALL: [Self; 7] = [
        Self::Glass,
        Self::Plate,
        Self::Box,
        Self::Prism,
        Self::Brick,
        Self::Board,
        Self::Clutter,
    ];

    /// Returns the word for it in files.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Glass => "glass",
            Self::Plate => "plate",
            Self::Box => "box",
            Self::Prism => "prism",
            Self::Brick => "brick",
            Self::Board => "board",
            Self::Clutter => "clutter",
        }
    }

    /// Returns the class of a word.
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|class| class.word() == word)
    }
}

impl fmt::Display for Class {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

/// Shape and size of an object, m, in its own frame, whose origin is the middle of its height.
///
/// The frame's z axis is up when the object lies as it is usually placed, and y is along its longest horizontal side
/// (section 6.3.3 of the thesis).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// An upright cup: outer radius, height, thickness of its wall and bottom.
    Glass {
        /// Outer radius.
        radius: f64,
        /// Along z.
        height: f64,
        /// Of wall and bottom.
        wall: f64,
    },
    /// A flat disc.
    Plate {
        /// Outer radius.
        radius: f64,
        /// Along z.
        height: f64,
    },
    /// A cuboid.
    Box {
        /// Edges along x, y and z; y is at least x.
        size: [f64; 3],
    },
    /// An upright prism over an equilateral triangle whose centroid is the origin and one side of which is along y, at
    /// negative x.
    Prism {
        /// Side of the triangle.
        side: f64,
        /// Along z.
        height: f64,
    },
    /// A printed carton; size and texture are those of its kind, its longest edge along y, its shortest along z.
    Brick {
        /// Kind of carton.
        kind: BrickKind,
    },
    /// A calibration board of `columns` times `rows` **inner** corners; columns run along y.
    Board {
        /// Inner corners along y.
        columns: u32,
        /// Inner corners along x.
        rows: u32,
        /// Side of a square.
        square: f64,
    },
    /// A thin or small cuboid that is no object to look for.
    Clutter {
        /// Edges along x, y and z.
        size: [f64; 3],
    },
}

/// Thickness of a calibration board, m.
pub const BOARD_THICKNESS: f64 = 0.004;

impl Shape {
    /// Returns the class.
    pub const fn class(&self) -> Class {
        match self {
            Self::Glass { .. } => Class::Glass,
            Self::Plate { .. } => Class::Plate,
            Self::Box { .. } => Class::Box,
            Self::Prism { .. } => Class::Prism,
            Self::Brick { .. } => Class::Brick,
            Self::Board { .. } => Class::Board,
            Self::Clutter { .. } => Class::Clutter,
        }
    }

    /// Returns the edges of the cuboid that just contains it, along its own axes, centred at its origin, m.
    ///
    /// A prism's triangle reaches further on one side of the origin; the cuboid has twice the larger reach.
    pub fn extent(&self) -> [f64; 3] {
        match *self {
            Self::Glass { radius, height, .. } | Self::Plate { radius, height } => {
                [2.0 * radius, 2.0 * radius, height]
            }
            Self::Box { size } | Self::Clutter { size } => size,
            Self::Prism { side, height } => [2.0 * side / 3.0_f64.sqrt(), side, height],
            Self::Brick { kind } => kind.size(),
            Self::Board {
                columns,
                rows,
                square,
            } => {
                // A border of one square around the outer squares.
                let edge = |corners: u32| f64::from(corners + 3) * square;
                [edge(rows), edge(columns), BOARD_THICKNESS]
            }
        }
    }

    /// Returns the height of its top above its origin, m, while it stands or lies as usual.
    pub fn half_height(&self) -> f64 {
        self.extent()[2] / 2.0
    }

    /// Returns the radius of the circle about its z axis that contains it, m.
    pub fn footprint_radius(&self) -> f64 {
        let [x, y, _] = self.extent();
        match self {
            Self::Glass { radius, .. } | Self::Plate { radius, .. } => *radius,
            Self::Prism { side, .. } => side / 3.0_f64.sqrt(),
            _ => x.hypot(y) / 2.0,
        }
    }

    /// Returns the corners of the triangle of a prism in its xy plane, counterclockwise, m.
    pub fn triangle(side: f64) -> [[f64; 2]; 3] {
        let apex = side / 3.0_f64.sqrt();
        let base = -apex / 2.0;
        [[apex, 0.0], [base, side / 2.0], [base, -side / 2.0]]
    }
}

/// Looks of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Finish {
    /// Diffuse reflectance in red, green and blue, linear, 0 to 1.
    pub colour: [f32; 3],
    /// Colour of rims, stripes and labels.
    pub accent: [f32; 3],
    /// Strength of highlights, 0 to 1.
    pub gloss: f32,
    /// Part of the light that does not go through, 0 to 1.
    pub opacity: f32,
    /// Seed of what else is random about its looks.
    pub seed: u64,
}

impl Default for Finish {
    fn default() -> Self {
        Self {
            colour: [0.6, 0.6, 0.6],
            accent: [0.2, 0.2, 0.25],
            gloss: 0.1,
            opacity: 1.0,
            seed: 0,
        }
    }
}

/// An object of the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// Number that stays the same as long as the object exists.
    pub id: u32,
    /// Shape and size.
    pub shape: Shape,
    /// kg.
    pub mass: f64,
    /// Coulomb friction coefficient against rubber; against the table the pair's mean counts.
    pub friction: f64,
    /// Looks.
    pub finish: Finish,
    /// Pose of the object's frame in the arm's base frame.
    pub pose: Pose,
}

impl Object {
    /// Creates an object of this shape with the usual mass and friction of its class.
    ///
    /// Source of the values: catalogue values, `docs/table-simulation.md`.
    pub fn new(id: u32, shape: Shape, pose: Pose) -> Self {
        let (mass, friction) = match shape {
            Shape::Glass { .. } => (0.2, 0.5),
            Shape::Plate { .. } => (0.35, 0.4),
            Shape::Box { .. } => (0.2, 0.6),
            Shape::Prism { .. } => (0.1, 0.6),
            Shape::Brick { kind } => (kind.mass(), 0.6),
            Shape::Board { .. } => (0.2, 0.6),
            Shape::Clutter { .. } => (0.02, 0.6),
        };
        Self {
            id,
            shape,
            mass,
            friction,
            finish: Finish::default(),
            pose,
        }
    }

    /// Returns the class.
    pub fn class(&self) -> Class {
        self.shape.class()
    }
}
