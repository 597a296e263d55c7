//! Matrices.

use bytes::{BufMut, Bytes, BytesMut};

use super::element::collect;
use super::prefix_reader::{Front, ReadPrefix, read_whole};
use crate::bottle::DecodeError;
use crate::float_vector::{float64_list, put_float64s};
use crate::message::{ReadObject, WireObject};
use crate::wire_version::WireVersion;

/// A matrix of floating point numbers, stock's `yarp::sig::Matrix`.
///
/// ```text
/// 256  3             list of three
/// 1    rows
/// 1    columns
/// 256 + code of float64  n   n x float64, row after row
/// ```
///
/// The same bytes are the bottle `rows columns (values)`. As in stock, a matrix without elements
/// is written but **refused on reading**. Also refused is a count n that is not rows x columns:
/// stock believes it and writes past the end of its matrix.
///
/// Source: bytes written and read by 3.5.0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Matrix {
    rows: usize,
    columns: usize,
    values: Vec<f64>,
}

/// Values that do not fill the matrix.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[error("a matrix of {rows} x {columns} takes as many values, got {got}")]
pub struct MatrixError {
    /// Rows asked for.
    pub rows: usize,
    /// Columns asked for.
    pub columns: usize,
    /// Values given.
    pub got: usize,
}

impl Matrix {
    /// Creates a matrix of zeros.
    ///
    /// # Panics
    ///
    /// If `rows * columns` numbers cannot be held at all.
    pub fn zeros(rows: usize, columns: usize) -> Self {
        let count = rows
            .checked_mul(columns)
            .expect("a matrix that fits memory");
        Self {
            rows,
            columns,
            values: vec![0.0; count],
        }
    }

    /// Returns a matrix of `values`, row after row.
    pub fn new(rows: usize, columns: usize, values: Vec<f64>) -> Result<Self, MatrixError> {
        if rows.checked_mul(columns) != Some(values.len()) {
            let got = values.len();
            return Err(MatrixError { rows, columns, got });
        }
        Ok(Self {
            rows,
            columns,
            values,
        })
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Row `row` from the top.
    pub fn row(&self, row: usize) -> Option<&[f64]> {
        (row < self.rows).then(|| &self.values[row * self.columns..(row + 1) * self.columns])
    }

    /// Returns the number in `row` and `column`.
    pub fn get(&self, row: usize, column: usize) -> Option<f64> {
        self.row(row)?.get(column).copied()
    }

    /// The number in `row` and `column`, to be changed.
    pub fn get_mut(&mut self, row: usize, column: usize) -> Option<&mut f64> {
        let inside = row < self.rows && column < self.columns;
        inside.then(|| &mut self.values[row * self.columns + column])
    }

    /// All numbers, row after row.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// All numbers themselves, row after row.
    pub fn into_values(self) -> Vec<f64> {
        self.values
    }
}

impl WireObject for Matrix {
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        for word in [256, 3, 1, self.rows as i32, 1, self.columns as i32] {
            out.put_i32_le(word);
        }
        put_float64s(out, &self.values, wire_version);
    }
}

impl ReadPrefix for Matrix {
    fn take(bytes: &mut Bytes, wire_version: WireVersion) -> Result<Self, DecodeError> {
        let mut front = Front::new(bytes, "a matrix: rows, columns and that many values");
        front.words(&[256, 3, 1])?;
        let rows = front.count()?;
        front.words(&[1])?;
        let columns = front.count()?;
        front.words(&[float64_list(wire_version)])?;
        let count = front.count()?;
        if count == 0 || rows.checked_mul(columns) != Some(count) {
            return Err(front.shape());
        }
        let values = collect(&front.run(count, 8)?);
        Ok(Self {
            rows,
            columns,
            values,
        })
    }
}

impl ReadObject for Matrix {
    fn read_binary(bytes: &Bytes, wire_version: WireVersion) -> Result<Self, DecodeError> {
        read_whole(bytes, wire_version)
    }
}
