//! Splits files of consecutive JPEG images, as `ffmpeg -c:v mjpeg out.mjpeg` writes them.
//!
//! ImageSource: ISO/IEC 10918-1, annex B: markers and the segments that follow them.

use std::ops::Range;

const START: u8 = 0xd8;
const END: u8 = 0xd9;
const SCAN: u8 = 0xda;

/// Returns the byte ranges of the images. An incomplete last image is left out, and so are bytes between images.
pub fn images(bytes: &[u8]) -> Vec<Range<usize>> {
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(start) = marker(bytes, at, START) {
        match end_of(bytes, start + 2) {
            Some(end) => {
                found.push(start..end);
                at = end;
            }
            None => at = start + 2,
        }
    }
    found
}

/// The next place from `at` on that has this marker.
fn marker(bytes: &[u8], at: usize, code: u8) -> Option<usize> {
    let found = bytes
        .get(at..)?
        .windows(2)
        .position(|pair| pair == [0xff, code])?;
    Some(at + found)
}

/// Returns the end of the image whose first segment begins at `at`. Segments are skipped by their length, because
/// they may contain images of their own.
fn end_of(bytes: &[u8], mut at: usize) -> Option<usize> {
    loop {
        let [0xff, code] = *bytes.get(at..at + 2)? else {
            return None;
        };
        match code {
            END => return Some(at + 2),
            START => return None,
            // Fill bytes, and markers without a length.
            0xff => at += 1,
            0x01 | 0xd0..=0xd7 => at += 2,
            _ => {
                let length = bytes.get(at + 2..at + 4)?;
                let length = usize::from(u16::from_be_bytes([length[0], length[1]]));
                at += 2 + length.max(2);
                if code == SCAN {
                    at = end_of_scan(bytes, at)?;
                }
            }
        }
    }
}

/// Returns the end of the data of a scan: a marker that is neither a stuffed byte nor a restart.
fn end_of_scan(bytes: &[u8], at: usize) -> Option<usize> {
    let data = bytes.get(at..)?.windows(2);
    let mut ends = data
        .enumerate()
        .filter(|(_, pair)| pair[0] == 0xff && !matches!(pair[1], 0x00 | 0xff | 0xd0..=0xd7));
    ends.next().map(|(found, _)| at + found)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn picture(grey: u8) -> Vec<u8> {
        let mut bytes = Vec::new();
        let encoder = jpeg_encoder::Encoder::new(&mut bytes, 80);
        let pixels = vec![grey; 24 * 16];
        encoder
            .encode(&pixels, 24, 16, jpeg_encoder::ColorType::Luma)
            .unwrap();
        bytes
    }

    #[test]
    fn pictures_stand_one_behind_the_other() {
        let (one, other) = (picture(10), picture(200));
        let film = [&one[..], b"--boundary\r\n", &other, &one[..40]].concat();
        let found = images(&film);
        assert_eq!(found.len(), 2);
        assert_eq!(film[found[0].clone()], one);
        assert_eq!(film[found[1].clone()], other);
    }

    #[test]
    fn a_picture_within_a_picture_is_passed_over() {
        let (one, small) = (picture(10), picture(90));
        let mut comment = vec![0xff, 0xfe];
        comment.extend((small.len() as u16 + 2).to_be_bytes());
        let film = [&one[..2], &comment, &small, &one[2..]].concat();
        let found = images(&film);
        assert_eq!((found.len(), found[0].clone()), (1, 0..film.len()));
        assert!(crate::image::image_file::decode(&film).is_ok());
    }

    proptest! {
        #[test]
        fn whatever_stands_in_the_file_the_places_are_in_it(
            bytes in prop::collection::vec(prop_oneof![Just(0xff), Just(START), Just(END), Just(SCAN), any::<u8>()], 0..300)
        ) {
            let mut last = 0;
            for range in images(&bytes) {
                prop_assert!(last <= range.start && range.start < range.end && range.end <= bytes.len());
                last = range.end;
            }
        }
    }
}
