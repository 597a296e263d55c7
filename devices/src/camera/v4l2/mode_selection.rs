//! Choice of size, encoding and rate among those that a camera offers.

use std::collections::BTreeSet;

use super::Encoding;
use super::buffer_conversion::FrameLayout;
use crate::DeviceError;

/// Size that is taken, or the nearest one, if none is asked for: the default of stock.
const DEFAULT_SIZE: (usize, usize) = (640, 480);
/// Sizes that are offered of a camera which takes any between two limits.
const USUAL_SIZES: [(usize, usize); 5] = [
    (160, 120),
    (320, 240),
    (640, 480),
    (1280, 720),
    (1920, 1080),
];
/// Maximum number of sizes of one encoding that are offered.
const MAX_SIZES: usize = 128;
/// Share of a rate that may be missing, for intervals such as 1001/30000 s.
const RATE_TOLERANCE: f64 = 0.01;

/// Size, encoding and rate that callers want.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Wanted {
    /// Width and height; the nearest to [`DEFAULT_SIZE`] without.
    pub(super) size: Option<(usize, usize)>,
    /// Takes the centre of a larger image if the size is not offered.
    pub(super) crop: bool,
    /// Encoding; the cheapest without.
    pub(super) encoding: Option<Encoding>,
    /// Images a second; the camera's own rate without.
    pub(super) rate: Option<f64>,
}

/// A size and encoding that a camera offers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Offer {
    /// Encoding.
    pub(super) encoding: Encoding,
    /// Width and height.
    pub(super) size: (usize, usize),
    /// Highest rate, images per second, if the driver tells it.
    pub(super) max_rate: Option<f64>,
}

/// Sizes between two limits, as some drivers offer them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SizeSteps {
    /// Least width and height.
    pub(super) min: (u32, u32),
    /// Largest width and height.
    pub(super) max: (u32, u32),
    /// Distance of two widths, and of two heights; 0 counts as 1.
    pub(super) step: (u32, u32),
}

impl SizeSteps {
    /// Returns those of the usual sizes that are among them, with the wanted one first if it is.
    pub(super) fn sizes(&self, wanted: Option<(usize, usize)>) -> Vec<(usize, usize)> {
        let has_side = |side: usize, min: u32, max: u32, step: u32| {
            let (min, max, step) = (min as usize, max as usize, step.max(1) as usize);
            (min..=max).contains(&side) && (side - min).is_multiple_of(step)
        };
        let has = |size: &(usize, usize)| {
            has_side(size.0, self.min.0, self.max.0, self.step.0)
                && has_side(size.1, self.min.1, self.max.1, self.step.1)
        };
        let usual = USUAL_SIZES.into_iter().filter(|size| Some(*size) != wanted);
        let smallest = (self.min.0 as usize, self.min.1 as usize);
        let mut sizes: Vec<_> = wanted.into_iter().chain(usual).filter(has).collect();
        if sizes.is_empty() {
            sizes.push(smallest);
        }
        sizes
    }
}

/// Returns the offers of an encoding: sizes that an image may have, not more of them than a camera needs.
pub(super) fn offers_of(
    encoding: Encoding,
    sizes: Vec<(usize, usize)>,
    mut max_rate: impl FnMut((usize, usize)) -> Option<f64>,
) -> Vec<Offer> {
    let sizes = sizes
        .into_iter()
        .filter(|size| FrameLayout::has_valid_size(*size));
    let offers = sizes.take(MAX_SIZES).map(|size| Offer {
        encoding,
        size,
        max_rate: max_rate(size),
    });
    offers.collect()
}

/// Chooses among `offers`.
///
/// A size that was asked for must be offered, or contained in a larger one that is cropped. Among the offers of one size, those
/// that reach the rate come first, then the cheapest encoding.
pub(super) fn choose(offers: &[Offer], wanted: &Wanted) -> Result<Offer, DeviceError> {
    if offers.is_empty() {
        let known: Vec<_> = Encoding::ALL.iter().map(|one| one.fourcc()).collect();
        return Err(DeviceError::NotSupported {
            what: format!("a format other than {}", known.join(", ")),
        });
    }
    let of_encoding = |one: &&Offer| {
        wanted
            .encoding
            .is_none_or(|encoding| one.encoding == encoding)
    };
    let offers: Vec<_> = offers.iter().filter(of_encoding).copied().collect();
    if offers.is_empty() {
        return Err(DeviceError::Unsuitable {
            what: "format",
            asked: wanted.encoding.map_or(String::new(), |one| one.to_string()),
            expected: "one that the camera offers, or none to let it be chosen".to_owned(),
        });
    }
    let size = chosen_size(&offers, wanted)?;
    let reaches = |one: &Offer| match (wanted.rate, one.max_rate) {
        (Some(rate), Some(max)) => max >= rate * (1.0 - RATE_TOLERANCE),
        _ => true,
    };
    let of_size = offers.into_iter().filter(|one| one.size == size);
    let best = of_size.min_by(|one, other| {
        let max_rate = |one: &Offer| one.max_rate.unwrap_or(0.0);
        let by_rate = reaches(other).cmp(&reaches(one));
        let by_rate = by_rate.then_with(|| match reaches(one) {
            true => std::cmp::Ordering::Equal,
            false => max_rate(other).total_cmp(&max_rate(one)),
        });
        by_rate.then(one.encoding.cmp(&other.encoding))
    });
    best.ok_or(DeviceError::NoDataYet { what: "offer" })
}

fn chosen_size(offers: &[Offer], wanted: &Wanted) -> Result<(usize, usize), DeviceError> {
    let sizes: BTreeSet<_> = offers.iter().map(|one| one.size).collect();
    let area = |size: &(usize, usize)| size.0 * size.1;
    let Some(asked) = wanted.size else {
        let distance = |size: &&(usize, usize)| {
            (
                area(size).abs_diff(area(&DEFAULT_SIZE)),
                size.0.abs_diff(DEFAULT_SIZE.0),
            )
        };
        let nearest = sizes.iter().min_by_key(distance);
        return nearest
            .copied()
            .ok_or(DeviceError::NoDataYet { what: "size" });
    };
    if sizes.contains(&asked) {
        return Ok(asked);
    }
    let larger = sizes
        .iter()
        .filter(|size| wanted.crop && size.0 >= asked.0 && size.1 >= asked.1)
        .filter(|_| asked.0 > 0 && asked.1 > 0);
    larger
        .min_by_key(|size| area(size))
        .copied()
        .ok_or_else(|| {
            let names: Vec<_> = sizes
                .iter()
                .map(|size| format!("{} x {}", size.0, size.1))
                .collect();
            DeviceError::Unsuitable {
                what: "resolution",
                asked: format!("{} x {}", asked.0, asked.1),
                expected: match wanted.crop {
                    true => format!("one inside of {}", names.join(", ")),
                    false => format!("one of {}, or crop for a part of one", names.join(", ")),
                },
            }
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn offer(encoding: Encoding, size: (usize, usize), max_rate: f64) -> Offer {
        Offer {
            encoding,
            size,
            max_rate: Some(max_rate),
        }
    }

    /// A webcam on USB 2, where large images are fast enough only when compressed.
    fn webcam() -> Vec<Offer> {
        vec![
            offer(Encoding::Yuyv, (320, 240), 30.0),
            offer(Encoding::Yuyv, (640, 480), 29.97),
            offer(Encoding::Yuyv, (1280, 720), 9.0),
            offer(Encoding::Mjpg, (640, 480), 30.0),
            offer(Encoding::Mjpg, (1280, 720), 30.0),
            offer(Encoding::Mjpg, (1920, 1080), 15.0),
            offer(Encoding::Yuyv, (1920, 1080), 5.0),
        ]
    }

    fn chosen(wanted: Wanted) -> (Encoding, (usize, usize)) {
        let chosen = choose(&webcam(), &wanted).unwrap();
        (chosen.encoding, chosen.size)
    }

    fn wanted(size: (usize, usize), rate: f64) -> Wanted {
        Wanted {
            size: Some(size),
            rate: Some(rate),
            ..Wanted::default()
        }
    }

    #[test]
    fn the_cheapest_encoding_that_is_fast_enough_is_taken() {
        assert_eq!(chosen(Wanted::default()), (Encoding::Yuyv, (640, 480)));
        let vga = (640, 480);
        assert_eq!(
            chosen(wanted(vga, 30.0)),
            (Encoding::Yuyv, vga),
            "29.97 is 30"
        );
        let hd = (1280, 720);
        assert_eq!(chosen(wanted(hd, 30.0)), (Encoding::Mjpg, hd));
        assert_eq!(chosen(wanted(hd, 5.0)), (Encoding::Yuyv, hd));
        // None is fast enough: the fastest.
        let full = (1920, 1080);
        assert_eq!(chosen(wanted(full, 30.0)), (Encoding::Mjpg, full));
        let unknown = [
            Offer {
                max_rate: None,
                ..offer(Encoding::Mjpg, hd, 0.0)
            },
            offer(Encoding::Yuyv, hd, 10.0),
        ];
        let chosen = choose(&unknown, &wanted(hd, 30.0)).unwrap();
        assert_eq!(chosen.encoding, Encoding::Mjpg, "an unknown rate may do");
        let plain = [
            offer(Encoding::Bgr, hd, 30.0),
            offer(Encoding::Rgb, hd, 30.0),
        ];
        assert_eq!(
            choose(&plain, &wanted(hd, 30.0)).unwrap().encoding,
            Encoding::Rgb
        );
    }

    #[test]
    fn an_encoding_can_be_asked_for() {
        let with = |encoding| Wanted {
            encoding: Some(encoding),
            ..Wanted::default()
        };
        assert_eq!(chosen(with(Encoding::Mjpg)), (Encoding::Mjpg, (640, 480)));
        let refused = choose(&webcam(), &with(Encoding::Rgb)).unwrap_err();
        assert!(refused.to_string().contains("RGB3"), "{refused}");
        let refused = choose(&[], &Wanted::default()).unwrap_err();
        assert!(refused.to_string().contains("YUYV"), "{refused}");
    }

    #[test]
    fn sizes_that_are_not_offered_are_refused_unless_cropped() {
        let odd = wanted((600, 400), 30.0);
        let refused = choose(&webcam(), &odd).unwrap_err().to_string();
        assert!(
            refused.contains("600 x 400") && refused.contains("640 x 480"),
            "{refused}"
        );
        let crop = |size| Wanted {
            crop: true,
            ..wanted(size, 30.0)
        };
        assert_eq!(chosen(crop((600, 400))), (Encoding::Yuyv, (640, 480)));
        assert_eq!(chosen(crop((960, 720))), (Encoding::Mjpg, (1280, 720)));
        for size in [(1921, 1), (1, 1081), (0, 0), (0, 10), (10, 0)] {
            assert!(choose(&webcam(), &crop(size)).is_err(), "{size:?}");
        }
    }

    #[test]
    fn offers_are_bounded() {
        let sizes = (0..1000)
            .map(|side| (side, 20))
            .chain([(20, 1 << 20)])
            .collect();
        let offers = offers_of(Encoding::Yuyv, sizes, |size| Some(size.0 as f64));
        assert_eq!(offers.len(), MAX_SIZES);
        assert_eq!(
            offers[0],
            offer(Encoding::Yuyv, (1, 20), 1.0),
            "no side is 0"
        );
        let none = offers_of(Encoding::Yuyv, vec![(20, 1 << 20)], |_| None);
        assert!(none.is_empty());
    }

    #[test]
    fn sizes_in_steps_are_those_on_a_step() {
        let steps = SizeSteps {
            min: (32, 16),
            max: (1280, 720),
            step: (16, 8),
        };
        let usual = [(160, 120), (320, 240), (640, 480), (1280, 720)];
        assert_eq!(steps.sizes(None), usual);
        assert_eq!(steps.sizes(Some((48, 24)))[..2], [(48, 24), (160, 120)]);
        assert_eq!(steps.sizes(Some((640, 480))).len(), 4);
        for size in [(49, 24), (48, 25), (16, 16), (1296, 720), (0, 0)] {
            assert_eq!(steps.sizes(Some(size)), usual, "{size:?}");
        }
        let step = SizeSteps {
            step: (0, 0),
            ..steps
        };
        assert_eq!(step.sizes(Some((49, 25)))[0], (49, 25));
        let small = SizeSteps {
            max: (40, 30),
            ..steps
        };
        assert_eq!(small.sizes(None), [(32, 16)]);
    }

    #[test]
    fn the_default_size_is_the_nearest() {
        let only = [
            offer(Encoding::Yuyv, (320, 180), 30.0),
            offer(Encoding::Yuyv, (1280, 720), 30.0),
        ];
        let chosen = choose(&only, &Wanted::default()).unwrap();
        assert_eq!(chosen.size, (320, 180));
    }
}
