//! The chessboard.

use std::fmt;
use std::str::FromStr;

use nalgebra::Point3;

use super::{CalibrationError, Result};

/// Minimum and maximum number of inner corners along one side.
const CORNERS: std::ops::RangeInclusive<u32> = 3..=64;

/// A chessboard, counted in inner corners.
///
/// Its frame has the origin at the first corner, x along the first row, y along the first column and z **into** the board,
/// away from the camera. The first corner is the one whose inner square is dark: unambiguous if one of the two
/// numbers is odd and the other even.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pattern {
    columns: u32,
    rows: u32,
    square: f64,
}

impl Pattern {
    /// Returns a pattern with `columns` times `rows` inner corners and squares of `square` m.
    ///
    /// Errors: [`CalibrationError::Pattern`] for fewer than 3 or more than 64 corners along a side, or squares that are not
    /// larger than 0.
    pub fn new(columns: u32, rows: u32, square: f64) -> Result<Self> {
        let fits = CORNERS.contains(&columns) && CORNERS.contains(&rows);
        if !(fits && square > 0.0 && square.is_finite()) {
            let text = format!("{columns}x{rows}, {square} m");
            return Err(CalibrationError::Pattern { text });
        }
        Ok(Self {
            columns,
            rows,
            square,
        })
    }

    /// Returns the same pattern with squares of another size, in m.
    ///
    /// Errors: [`CalibrationError::Pattern`] unless it is larger than 0.
    pub fn with_square(self, square: f64) -> Result<Self> {
        Self::new(self.columns, self.rows, square)
    }

    /// Returns the number of inner corners of a row.
    pub fn columns(&self) -> u32 {
        self.columns
    }

    /// Returns the number of inner corners of a column.
    pub fn rows(&self) -> u32 {
        self.rows
    }

    /// Returns the side of a square, in m.
    pub fn square(&self) -> f64 {
        self.square
    }

    /// Returns the number of inner corners.
    pub fn count(&self) -> usize {
        (self.columns * self.rows) as usize
    }

    /// Returns true if the colours of the squares tell the two possible orders of the corners apart.
    pub fn is_unambiguous(&self) -> bool {
        (self.columns + self.rows) % 2 == 1
    }

    /// Returns the inner corners in the pattern's frame, row by row, in m.
    pub fn corners(&self) -> Vec<Point3<f64>> {
        let place = |index: u32| f64::from(index) * self.square;
        (0..self.rows)
            .flat_map(|row| (0..self.columns).map(move |column| (row, column)))
            .map(|(row, column)| Point3::new(place(column), place(row), 0.0))
            .collect()
    }
}

/// Reads `9x6` as a pattern with squares of 1 m.
impl FromStr for Pattern {
    type Err = CalibrationError;

    fn from_str(text: &str) -> Result<Self> {
        let refused = || CalibrationError::Pattern {
            text: text.to_owned(),
        };
        let (columns, rows) = text.split_once(['x', 'X']).ok_or_else(refused)?;
        let number = |word: &str| word.parse().map_err(|_| refused());
        Self::new(number(columns)?, number(rows)?, 1.0).map_err(|_| refused())
    }
}

impl fmt::Display for Pattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.columns, self.rows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_becomes_a_pattern() {
        let pattern: Pattern = "9x6".parse().unwrap();
        assert_eq!((pattern.columns(), pattern.rows()), (9, 6));
        assert_eq!(pattern.to_string(), "9x6");
        assert!(pattern.is_unambiguous());
        assert!(!"7x5".parse::<Pattern>().unwrap().is_unambiguous());
        for text in [
            "",
            "9",
            "9x",
            "2x6",
            "9x65",
            "-9x6",
            "9x6x3",
            "4000000000x6",
        ] {
            let error = text.parse::<Pattern>().unwrap_err().to_string();
            assert!(error.contains("9x6"), "{error}");
        }
        for square in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(pattern.with_square(square).is_err());
        }
    }

    #[test]
    fn corners_are_counted_row_by_row() {
        let corners = Pattern::new(9, 6, 0.02).unwrap().corners();
        assert_eq!(corners.len(), 54);
        assert_eq!(corners[1], Point3::new(0.02, 0.0, 0.0));
        assert_eq!(corners[9], Point3::new(0.0, 0.02, 0.0));
    }
}
