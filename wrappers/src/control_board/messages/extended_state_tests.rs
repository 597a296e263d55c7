use super::*;

/// Message of a stock 3.12.3 board with seven fake joints.
const RECORDED: &str = "
    0001000016000000
    0a01000007000000000000f0d4f72b40000000000000f03f00000000000008400000000000000000000000000000000000000000000000000000000000001440 090000006f6b0000
    0a010000070000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000 090000006f6b0000
    0a010000070000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000 090000006f6b0000
    0a0100000700000000000016e57a614000000000000024400000000000003e400000000000000000000000000000000000000000000000000000000000004940 090000006f6b0000
    0a010000070000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000 090000006f6b0000
    0a010000070000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000 090000006f6b0000
    0a010000070000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000 090000006f6b0000
    0a010000070000000000000000804040000000000000414000000000008041400000000000004240000000000080424000000000000043400000000000804340 090000006f6b0000
    0a010000070000000000000000c8a940000000000090aa40000000000058ab40000000000020ac400000000000e8ac400000000000b0ad40000000000078ae40 090000006f6b0000
    0101000007000000706f7300706f7300706f7300706f7300706f7300706f7300706f7300 090000006f6b0000
    010100000700000073746966000000000000000000000000000000000000000000000000 090000006f6b0000
";

/// Message of a stock 4.0.0 board with seven fake joints.
const RECORDED_4: &str = "
    0001000018000000
    14010000070000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000 090000006f6b0000
    14010000070000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000 090000006f6b0000
    14010000070000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000 090000006f6b0000
    14010000070000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000 090000006f6b0000
    14010000070000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000 090000006f6b0000
    14010000070000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000 090000006f6b0000
    14010000070000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000 090000006f6b0000
    0a01000007000000000004420000084200000c4200001042000014420000184200001c42 090000006f6b0000
    14010000070000000000000000c8a940000000000090aa40000000000058ab40000000000020ac400000000000e8ac400000000000b0ad40000000000078ae40 090000006f6b0000
    0101000007000000706f7300706f7300706f7300706f7300706f7300706f7300706f7300 090000006f6b0000
    010100000700000000000000000000000000000000000000000000000000000000000000 090000006f6b0000
    0a010000070000000000164200001a4200001e42000022420000264200002a4200002e42 090000006f6b0000
";

/// Spaces in the hexadecimal text are for people.
fn bytes(hex: &str) -> Bytes {
    let digits: Vec<u8> = hex.bytes().filter(u8::is_ascii_hexdigit).collect();
    digits
        .chunks(2)
        .map(|pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap())
        .collect()
}

fn encoded(data: &JointData, wire_version: WireVersion) -> Bytes {
    let mut out = BytesMut::new();
    data.write_binary(&mut out, wire_version);
    out.freeze()
}

fn one_joint_at_ten_degrees() -> JointData {
    let mut data = JointData::unknown(1);
    data.positions.values[0] = 10.0;
    data.control_modes.values[0] = Mode::Position;
    data.interaction_modes.values[0] = Interaction::Stiff;
    for field in [
        &mut data.positions,
        &mut data.velocities,
        &mut data.accelerations,
        &mut data.motor_positions,
        &mut data.motor_velocities,
        &mut data.motor_accelerations,
        &mut data.torques,
        &mut data.duty_cycles,
        &mut data.currents,
        &mut data.temperatures,
    ] {
        field.valid = true;
    }
    data.control_modes.valid = true;
    data.interaction_modes.valid = true;
    data
}

#[test]
fn a_recorded_state_comes_out_as_it_went_in() {
    let recorded = bytes(RECORDED);
    let data = JointData::read_binary(&recorded, WireVersion::V3).unwrap();
    assert_eq!(data.positions.of(7).unwrap()[1..3], [1.0, 3.0]);
    assert_eq!(data.control_modes.of(7).unwrap(), [Mode::Position; 7]);
    assert_eq!(data.interaction_modes.values[0], Interaction::Stiff);
    assert_eq!(data.positions.of(6), None);
    assert_eq!(encoded(&data, WireVersion::V3), recorded);
}

#[test]
fn a_recorded_state_of_4_comes_out_as_it_went_in() {
    let recorded = bytes(RECORDED_4);
    let data = JointData::read_binary(&recorded, WireVersion::V4).unwrap();
    assert_eq!(data.duty_cycles.of(7).unwrap()[..2], [33.0, 34.0]);
    assert_eq!(data.temperatures.of(7).unwrap()[0], 37.5);
    assert_eq!(encoded(&data, WireVersion::V4), recorded);
}

#[test]
fn one_joint_is_these_bytes() {
    let zeros = |floats: &str, count: usize| {
        format!("{floats} 01000000 0000000000000000 09000000 6f6b0000").repeat(count)
    };
    let modes = "01010000 01000000 706f7300 09000000 6f6b0000
                 01010000 01000000 73746966 09000000 6f6b0000";
    let mut data = one_joint_at_ten_degrees();
    data.temperatures.values[0] = 25.0;

    let old = format!(
        "00010000 16000000 0a010000 01000000 0000000000002440 09000000 6f6b0000 {} {modes}",
        zeros("0a010000", 8),
    );
    assert_eq!(encoded(&data, WireVersion::V3), bytes(&old));
    assert_eq!(encoded(&data, WireVersion::V3).len(), 264);

    let new = format!(
        "00010000 18000000 14010000 01000000 0000000000002440 09000000 6f6b0000 {}
         0a010000 01000000 00000000 09000000 6f6b0000 {} {modes}
         0a010000 01000000 0000c841 09000000 6f6b0000",
        zeros("14010000", 6),
        zeros("14010000", 1),
    );
    assert_eq!(encoded(&data, WireVersion::V4), bytes(&new));
    assert_eq!(encoded(&data, WireVersion::V4).len(), 280);
    assert_eq!(
        JointData::read_binary(&bytes(&new), WireVersion::V4).as_ref(),
        Ok(&data)
    );

    // What 3.x does not carry is not known at the other end.
    data.temperatures = Field {
        values: Vec::new(),
        valid: false,
    };
    assert_eq!(
        JointData::read_binary(&bytes(&old), WireVersion::V3),
        Ok(data)
    );
}

#[test]
fn what_is_unknown_still_has_an_entry_for_each_joint() {
    let data = JointData::unknown(6);
    assert_eq!(encoded(&data, WireVersion::V3).len(), 184 + 80 * 6);
    assert_eq!(encoded(&data, WireVersion::V4).len(), 200 + 80 * 6);
    assert_eq!(data.positions.of(6), None);
}

#[test]
fn flags_may_come_as_integers() {
    let bottle = Bottle::decode(
        &encoded(&one_joint_at_ten_degrees(), WireVersion::V3),
        WireVersion::V3,
        Limits::DEFAULT,
    );
    let mut items = bottle.unwrap().into_items();
    items[1] = Value::Int32(1);
    items[3] = Value::Int32(0);
    let data = read(&Bottle::from(items.clone())).unwrap();
    assert!(data.positions.valid && !data.velocities.valid);
    items.pop();
    assert_eq!(read(&Bottle::from(items)), None);
}

#[test]
fn a_state_cut_short_anywhere_is_an_error() {
    let whole = bytes(RECORDED);
    for end in 0..whole.len() {
        assert!(JointData::read_binary(&whole.slice(..end), WireVersion::V3).is_err());
    }
}
