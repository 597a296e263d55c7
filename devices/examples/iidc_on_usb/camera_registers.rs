//! Registers of the simulated camera: IIDC 1.31, each at its address in the space of IEEE 1394.

use std::collections::BTreeMap;

/// GUID of the camera.
pub(crate) const GUID: u64 = 0x00b0_9d01_00c0_ffee;
/// Versions of IIDC, as the sub-version of the unit.
pub(crate) const IIDC_1_30: u32 = 0;
pub(crate) const IIDC_1_31: u32 = 0x10;
/// Address of the command registers.
const BASE: u64 = 0xffff_f0f0_0000;
const ROM: u64 = 0xffff_f000_0400;
/// Offset of the registers of format 7 from the command registers.
const SCALABLE: u64 = 0x4000;
/// Largest window, and its steps.
pub(crate) const SENSOR: (u32, u32) = (320, 240);
const STEPS: (u32, u32) = (8, 2);
/// Packets: their steps and the largest, bytes.
const PACKET_STEP: u32 = 4;
const LARGEST_PACKET: u32 = 4096;
const RECOMMENDED_PACKET: u32 = 1024;

/// Features with presence, modes and range: their places in the list.
pub(crate) const BRIGHTNESS: u64 = 0;
pub(crate) const WHITE_BALANCE: u64 = 3;
pub(crate) const SHUTTER: u64 = 7;
pub(crate) const GAIN: u64 = 8;
pub(crate) const PAN: u64 = 17;

/// Frames that the camera is to send.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sending {
    pub(crate) coding: u32,
    pub(crate) corner: (usize, usize),
    pub(crate) size: (usize, usize),
    pub(crate) interval_us: u64,
    /// Bytes of a frame with its padding.
    pub(crate) bytes: usize,
}

/// Registers of a camera.
#[derive(Debug)]
pub(crate) struct Registers {
    values: BTreeMap<u64, u32>,
    rom: Vec<u32>,
    /// True for a camera that is off after power on and reset.
    pub(crate) starts_off: bool,
    /// Writes of settings of format 7 that the camera has refused.
    refused: bool,
    /// Packets of a frame that the camera claims, instead of those that it sends.
    pub(crate) claimed_packets: Option<u32>,
}

fn leaf(words: &str) -> Vec<u32> {
    let mut letters = words.as_bytes().to_vec();
    letters.resize(letters.len().div_ceil(4) * 4, 0);
    let texts = letters
        .chunks(4)
        .map(|four| u32::from_be_bytes([four[0], four[1], four[2], four[3]]));
    let mut quads = vec![0, 0, 0];
    quads.extend(texts);
    quads[0] = (quads.len() as u32 - 1) << 16;
    quads
}

fn rom(guid: u64, sub_version: u32) -> Vec<u32> {
    let (vendor, model) = (leaf("Point Grey Research"), leaf("Simulated Chameleon"));
    let mut quads = vec![
        0x0404_0000,
        u32::from_be_bytes(*b"1394"),
        0x0000_a002,
        (guid >> 32) as u32,
        guid as u32,
        // The root directory.
        3 << 16,
        0x0300_b09d,
        0x0c00_83c0,
        0xd100_0001,
        // The unit.
        3 << 16,
        0x1200_a02d,
        0x1300_0102,
        0xd400_0001,
        // What depends on the unit: command registers, vendor, model, version.
        4 << 16,
        0x403c_0000,
        0x8100_0003,
        0x8200_0002 + vendor.len() as u32,
        0x3800_0000 | sub_version,
    ];
    quads.extend(vendor);
    quads.extend(model);
    quads
}

impl Default for Registers {
    fn default() -> Self {
        Self::of_camera(GUID, IIDC_1_31)
    }
}

impl Registers {
    /// Creates the registers of a camera with this GUID and version of IIDC.
    pub(crate) fn of_camera(guid: u64, sub_version: u32) -> Self {
        let mut registers = Self {
            values: BTreeMap::new(),
            rom: rom(guid, sub_version),
            starts_off: false,
            refused: false,
            claimed_packets: None,
        };
        registers.initialize();
        registers
    }
}

fn feature_place(feature: u64) -> u64 {
    if feature < 16 {
        feature * 4
    } else {
        0x80 + (feature - 16) * 4
    }
}

impl Registers {
    fn put(&mut self, place: u64, value: u32) {
        self.values.insert(place, value);
    }

    /// Returns a register, by its place after the beginning of the command registers.
    pub(crate) fn at(&self, place: u64) -> u32 {
        self.values.get(&place).copied().unwrap_or(0)
    }

    /// Returns the register of a feature.
    pub(crate) fn feature(&self, feature: u64) -> u32 {
        self.at(0x800 + feature_place(feature))
    }

    /// Returns whether images are to be sent.
    pub(crate) fn is_sending(&self) -> bool {
        self.at(0x614) >> 31 == 1 && self.at(0x610) >> 31 == 1
    }

    /// Returns format, mode and rate.
    pub(crate) fn video(&self) -> (u32, u32, u32) {
        (
            self.at(0x608) >> 29,
            self.at(0x604) >> 29,
            self.at(0x600) >> 29,
        )
    }

    /// Returns coding, corner, size and bytes in a packet of format 7.
    pub(crate) fn region(&self) -> (u32, (u32, u32), (u32, u32), u32) {
        let two = |value: u32| (value >> 16, value & 0xffff);
        (
            self.at(SCALABLE + 0x10) >> 24,
            two(self.at(SCALABLE + 0x08)),
            two(self.at(SCALABLE + 0x0c)),
            self.at(SCALABLE + 0x44) >> 16,
        )
    }

    /// Makes the settings that the camera has after power on.
    pub(crate) fn initialize(&mut self) {
        self.values.clear();
        // Formats 0 and 7; modes 0, 1, 2, 5 and 6 of format 0, 0 of format 7.
        self.put(0x100, 1 << 31 | 1 << 24);
        self.put(0x180, 1 << 31 | 1 << 30 | 1 << 29 | 1 << 26 | 1 << 25);
        self.put(0x19c, 1 << 31);
        // Rates 7.5, 15, 30 of each, and 60 of the smallest.
        for mode in [0, 1, 2, 5, 6] {
            self.put(0x200 + 4 * mode, 0x3800_0000);
        }
        self.put(0x200, 0x3c00_0000);
        self.put(0x2e0, ((BASE - 0xffff_f000_0000 + SCALABLE) / 4) as u32);
        // 1394b, power switch, one shot.
        self.put(0x400, 1 << 23 | 1 << 15 | 1 << 12 | 1);
        self.put(0x600, 3 << 29);
        self.put(0x604, 0);
        self.put(0x608, 0);
        self.put(0x60c, 2 << 24);
        self.put(0x610, u32::from(!self.starts_off) << 31);
        self.put(0x614, 0);
        // Presence, one push, on and off, automatic, manual; then the range.
        let (present, one_push, switch, auto, manual) =
            (1 << 31, 1 << 28, 1 << 26, 1 << 25, 1 << 24);
        for (feature, inquiry, value) in [
            (BRIGHTNESS, present | manual | 255, 1 << 25 | 128),
            (
                WHITE_BALANCE,
                present | one_push | switch | auto | manual | 1023,
                1 << 25 | 512 << 12 | 512,
            ),
            (
                SHUTTER,
                present | 1 << 30 | auto | manual | 10 << 12 | 522,
                1 << 30 | 1 << 25 | 1 << 24 | 100,
            ),
            (
                GAIN,
                present | switch | auto | manual | 16 << 12 | 64,
                1 << 25 | 16,
            ),
            (PAN, present | manual | 2 << 12 | 5, 1 << 25 | 3),
        ] {
            let place = feature_place(feature);
            self.put(0x500 + place, inquiry);
            self.put(0x800 + place, present | value);
            let (register, bit) = if feature < 16 {
                (0x404, feature)
            } else {
                (0x408, feature - 16)
            };
            self.put(register, self.at(register) | 1 << (31 - bit));
        }
        self.put(SCALABLE, SENSOR.0 << 16 | SENSOR.1);
        self.put(SCALABLE + 0x04, STEPS.0 << 16 | STEPS.1);
        self.put(SCALABLE + 0x4c, STEPS.0 << 16 | STEPS.1);
        self.put(SCALABLE + 0x0c, SENSOR.0 << 16 | SENSOR.1);
        // Codings 0, 2, 4, 5 and 9, and the filter green blue, red green.
        self.put(
            SCALABLE + 0x14,
            1 << 31 | 1 << 29 | 1 << 27 | 1 << 26 | 1 << 22,
        );
        self.put(SCALABLE + 0x58, 1 << 24);
        self.put(SCALABLE + 0x40, PACKET_STEP << 16 | LARGEST_PACKET);
        self.put(SCALABLE + 0x44, RECOMMENDED_PACKET << 16);
        self.put(SCALABLE + 0x7c, 1 << 31);
        self.refused = false;
        self.derive();
    }

    /// Sets the registers that follow from others.
    fn derive(&mut self) {
        let (coding, _, (width, height), packet) = self.region();
        let bits = match coding {
            0 | 9 => 8,
            2 | 5 => 16,
            _ => 24,
        };
        let bytes = width * height * bits / 8;
        self.put(SCALABLE + 0x34, width * height);
        self.put(SCALABLE + 0x3c, bytes);
        self.put(SCALABLE + 0x44, packet << 16 | RECOMMENDED_PACKET);
        self.put(SCALABLE + 0x48, bytes.div_ceil(packet.max(1)));
        // Twelve bits of sixteen.
        let depth = if coding == 5 { 12 } else { 8 };
        self.put(SCALABLE + 0x54, depth << 24);
        let (format, mode, _) = self.video();
        let is_wide = (format, mode) == (0, 6) || (format, coding) == (7, 5);
        let depth = if is_wide { 12 } else { 8 };
        self.put(0x630, depth << 24);
    }

    /// Returns what is sent in the mode that is set.
    pub(crate) fn sending(&self) -> Option<Sending> {
        let (format, mode, rate) = self.video();
        let whole = |coding, width: usize, height: usize, bytes| Sending {
            coding,
            corner: (0, 0),
            size: (width, height),
            interval_us: 533_333 >> rate,
            bytes,
        };
        Some(match (format, mode) {
            (0, 0) => whole(3, 160, 120, 57_600),
            (0, 1) => whole(2, 320, 240, 153_600),
            (0, 2) => whole(1, 640, 480, 460_800),
            (0, 5) => whole(0, 640, 480, 307_200),
            (0, 6) => whole(5, 640, 480, 614_400),
            (7, 0) => {
                let (coding, corner, size, packet) = self.region();
                let packets = self.at(SCALABLE + 0x48);
                let sides = |(one, other): (u32, u32)| (one as usize, other as usize);
                Sending {
                    coding,
                    corner: sides(corner),
                    size: sides(size),
                    interval_us: u64::from(packets) * 125,
                    bytes: (packets * packet) as usize,
                }
            }
            _ => return None,
        })
    }

    /// Reads an address; `None` where nothing is.
    pub(crate) fn read(&self, address: u64) -> Option<u32> {
        if let Some(place) = address.checked_sub(BASE) {
            return (place < 0x5000).then(|| match place {
                place if place == SCALABLE + 0x7c => 1 << 31 | u32::from(self.refused) << 23,
                place if place == SCALABLE + 0x48 => self.claimed_packets.unwrap_or(self.at(place)),
                place => self.at(place),
            });
        }
        let place = address.checked_sub(ROM)?;
        self.rom.get((place / 4) as usize).copied()
    }

    /// Writes an address; `false` where nothing can be written.
    pub(crate) fn write(&mut self, address: u64, value: u32) -> bool {
        let Some(place) = address.checked_sub(BASE) else {
            return false;
        };
        match place {
            0x000 | 0x624 => self.initialize(),
            0x600..0x640 => self.put(place, value),
            0x800..0x900 => {
                // Presence stays, and a camera that adjusts once does so at once.
                let kept = self.at(place) & 1 << 31;
                let value = value & !(1 << 31) | kept;
                self.put(
                    place,
                    if value >> 26 & 1 == 1 {
                        value & !(1 << 26) & !0xfff | 777
                    } else {
                        value
                    },
                );
            }
            place if (SCALABLE..SCALABLE + 0x100).contains(&place) => {
                self.write_scalable(place, value)
            }
            _ => return false,
        }
        self.derive();
        true
    }

    fn write_scalable(&mut self, place: u64, value: u32) {
        let before = self.at(place);
        self.put(place, value);
        let (coding, (x, y), (width, height), packet) = self.region();
        let fits = self.at(SCALABLE + 0x14) >> (31 - coding.min(31)) & 1 == 1
            && (1..=SENSOR.0).contains(&(width + x).max(1))
            && x + width <= SENSOR.0
            && y + height <= SENSOR.1
            && width % STEPS.0 == 0
            && height % STEPS.1 == 0
            && (1..=LARGEST_PACKET).contains(&packet)
            && packet % PACKET_STEP == 0;
        self.refused = !fits;
        if !fits {
            self.put(place, before);
        }
    }
}
