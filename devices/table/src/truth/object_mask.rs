//! Sets of pixels as runs.

use super::Seen;

/// A set of pixels, as runs in the order of rows.
///
/// ```
/// use yarp_table::Mask;
///
/// let mask = Mask::from_bits(3, 2, &[false, true, true, true, false, false]);
/// assert_eq!(mask.runs(), &[(1, 3)]);
/// assert!(mask.contains(2, 0) && !mask.contains(1, 1));
/// ```
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct Mask {
    width: usize,
    height: usize,
    runs: Vec<(u32, u32)>,
}

impl Mask {
    /// Returns the set of the pixels that are true.
    ///
    /// Panics unless there are as many as width and height say.
    pub fn from_bits(width: usize, height: usize, bits: &[bool]) -> Self {
        assert_eq!(bits.len(), width * height);
        let mut mask = Self::empty(width, height);
        for (index, _) in bits.iter().enumerate().filter(|(_, bit)| **bit) {
            mask.push_run(index as u32, 1);
        }
        mask
    }

    /// Returns the set of these runs; `None` if they overlap, are out of order, empty, or leave the image.
    pub fn from_runs(width: usize, height: usize, runs: Vec<(u32, u32)>) -> Option<Self> {
        let mut end = 0_u64;
        for &(start, length) in &runs {
            if u64::from(start) < end || length == 0 {
                return None;
            }
            end = u64::from(start) + u64::from(length);
        }
        let fits = (width as u64)
            .checked_mul(height as u64)
            .is_some_and(|pixels| end <= pixels);
        fits.then_some(Self {
            width,
            height,
            runs,
        })
    }

    pub(super) fn empty(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            runs: Vec::new(),
        }
    }

    /// Adds pixels after all others.
    fn push_run(&mut self, first: u32, count: u32) {
        match self.runs.last_mut() {
            Some((start, length)) if *start + *length == first => *length += count,
            _ => self.runs.push((first, count)),
        }
    }

    /// Returns first pixel and length of each run; pixels are counted row after row.
    pub fn runs(&self) -> &[(u32, u32)] {
        &self.runs
    }

    /// Returns the number of pixels.
    pub fn area(&self) -> usize {
        self.runs.iter().map(|(_, length)| *length as usize).sum()
    }

    /// Returns the mean place of its pixels; `None` if it is empty.
    pub fn centroid(&self) -> Option<[f64; 2]> {
        let mut sum = [0.0; 2];
        for index in self.indices() {
            sum[0] += (index % self.width) as f64;
            sum[1] += (index / self.width) as f64;
        }
        let area = self.area() as f64;
        (area > 0.0).then(|| sum.map(|value| value / area))
    }

    /// Returns whether a pixel is in it.
    pub fn contains(&self, x: usize, y: usize) -> bool {
        let index = (y * self.width + x) as u32;
        let after = self.runs.partition_point(|(start, _)| *start <= index);
        x < self.width
            && y < self.height
            && after
                .checked_sub(1)
                .is_some_and(|run| index < self.runs[run].0 + self.runs[run].1)
    }

    /// Returns the numbers of its pixels, counted row after row.
    pub fn indices(&self) -> impl Iterator<Item = usize> + '_ {
        let run = |&(start, length): &(u32, u32)| start as usize..(start + length) as usize;
        self.runs.iter().flat_map(run)
    }
}

/// The mask of each owner.
pub(super) fn of_owners(seen: &Seen<'_>, owners: usize, width: usize, height: usize) -> Vec<Mask> {
    let mut masks = vec![Mask::empty(width, height); owners];
    let mut start = 0;
    for run in seen.keys.chunk_by(|one, other| one == other) {
        if let Some(owner) = (seen.owner_of)(run[0]) {
            masks[owner].push_run(start, run.len() as u32);
        }
        start += run.len() as u32;
    }
    masks
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn lying_runs_are_refused() {
        let taken = |runs: &[(u32, u32)]| Mask::from_runs(4, 4, runs.to_vec()).is_some();
        assert!(taken(&[(0, 2), (2, 2), (15, 1)]));
        assert!(!taken(&[(0, 2), (1, 2)]));
        assert!(!taken(&[(15, 2)]));
        assert!(!taken(&[(3, 0)]));
        assert!(!taken(&[(u32::MAX, u32::MAX)]));
    }

    proptest! {
        #[test]
        fn masks_hold_what_they_were_given(bits in proptest::collection::vec(any::<bool>(), 35)) {
            let mask = Mask::from_bits(7, 5, &bits);
            for (index, bit) in bits.iter().enumerate() {
                prop_assert_eq!(mask.contains(index % 7, index / 7), *bit);
            }
            prop_assert_eq!(mask.area(), bits.iter().filter(|bit| **bit).count());
            prop_assert_eq!(Mask::from_runs(7, 5, mask.runs().to_vec()), Some(mask.clone()));
        }
    }
}
