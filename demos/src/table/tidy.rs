//! Tidying the table over the network: one process serves table and name server, all devices are found by their names.

use std::io::Write;

use serde_json::{Value, json};
use yarp_client::Network;
use yarp_manipulation::{TidyOptions, TidyReport, tidy};
use yarp_table::{Class, Placement, Scene};

pub use yarp_manipulation::Stop;

use super::demo_session::{connect, show_task, with_table, write_result};
use super::{RemoteTruth, TableDemoError, TableDemoOptions, TablePlace};
use crate::DemoError;

/// Name of the ports that show the task, which every view knows.
const NAME: &str = "/tidy";

/// Tidies a table and writes the result; returns whether it is above the targets.
///
/// Blocks until the table is empty, or `stop` is pressed. With a table elsewhere nobody here knows the truth: then the
/// result has only what the client knows, and is above the targets if nothing was left.
pub fn run(
    options: &TableDemoOptions,
    stop: &Stop,
    json: bool,
    out: &mut dyn Write,
) -> Result<bool, DemoError> {
    let (report, judgement) = match &options.place {
        TablePlace::Remote(network, prefix) => (tidy_on(network, prefix, options, stop)?, None),
        TablePlace::Isolated | TablePlace::Here(_) => {
            let (report, judgement) = tidy_here(options, stop, out)?;
            (report, Some(judgement))
        }
    };
    let passed = match &judgement {
        Some(judgement) => judgement.passes(&report),
        None => report.error.is_none() && report.left.is_empty(),
    };
    let truth = judgement.as_ref();
    let result = json!({
        "demo": "tidy",
        "seed": options.seed,
        "objects": truth.map(|truth| truth.objects),
        "detector": report.detector,
        "noise_m": options.noise,
        "released": report.released,
        "placed": truth.map(|truth| truth.placed),
        "placed_within_two_attempts": truth.map(|truth| truth.within_two),
        "attempts": report.attempts,
        "missed": report.missed,
        "dropped": truth.map(|truth| report.released.saturating_sub(truth.placed + truth.misclassified)),
        "lost": truth.map(|truth| truth.lost),
        "misclassified": truth.map(|truth| truth.misclassified),
        "not_placed": truth.map(|truth| &truth.not_placed),
        "collisions": truth.map(|truth| truth.collisions),
        "lost_frames": truth.map(|truth| truth.lost_frames),
        "simulated_seconds": truth.map(|truth| truth.simulated),
        "simulated_seconds_per_object": truth.map(|truth| truth.simulated / truth.objects.max(1) as f64),
        "wall_seconds": truth.map(|truth| truth.wall),
        "times_real_time": truth.map(|truth| truth.simulated / truth.wall.max(1e-9)),
        "stopped": report.stopped,
        "left": report.left.iter().map(|(label, why)| json!({"label": label, "reason": why})).collect::<Vec<_>>(),
        "error": report.error.as_ref().map(ToString::to_string),
        "passed": passed,
    });
    write_result(&result, json, out)?;
    Ok(passed)
}

/// The end of a run, judged by the table itself.
struct Judgement {
    objects: usize,
    placed: usize,
    within_two: usize,
    lost: usize,
    misclassified: usize,
    /// Objects that are not in their basket, and where they are, m.
    not_placed: Vec<Value>,
    collisions: u64,
    lost_frames: u64,
    simulated: f64,
    wall: f64,
}

impl Judgement {
    fn of(scene: &Scene, report: &TidyReport) -> Self {
        let mut judgement = Self {
            objects: scene.objects.len(),
            placed: 0,
            within_two: 0,
            lost: 0,
            misclassified: 0,
            not_placed: Vec::new(),
            collisions: 0,
            lost_frames: 0,
            simulated: 0.0,
            wall: 0.0,
        };
        for object in &scene.objects {
            let place = object.pose.translation.vector;
            let wanted = match object.class() {
                Class::Glass => 1,
                Class::Plate => 2,
                _ => 0,
            };
            let found = scene
                .baskets
                .iter()
                .position(|basket| basket.contains(&place));
            if found != Some(wanted) {
                let place = [place.x, place.y, place.z].map(|metres| (metres * 1e3).round() / 1e3);
                let class = object.class().word();
                judgement
                    .not_placed
                    .push(json!({"class": class, "place": place}));
            }
            match found {
                Some(basket) if basket == wanted => {
                    let attempts = report.log.iter().filter(|(id, _)| *id == object.id).count();
                    judgement.placed += 1;
                    judgement.within_two += usize::from(attempts <= 2);
                }
                Some(_) => judgement.misclassified += 1,
                None => judgement.lost += usize::from(place.z < scene.table.surface - 0.01),
            }
        }
        if report.detector != RemoteTruth::NAME {
            // The numbers are the detector's own: each that took more than two attempts is an object that did.
            let mut ids: Vec<u32> = report.log.iter().map(|(id, _)| *id).collect();
            ids.sort_unstable();
            let many = ids.chunk_by(|one, other| one == other);
            let many = many.filter(|attempts| attempts.len() > 2).count();
            judgement.within_two = judgement.placed.saturating_sub(many);
        }
        judgement
    }

    /// Returns whether the run is above the targets of each object.
    fn passes(&self, report: &TidyReport) -> bool {
        let objects = self.objects as f64;
        let dropped = report
            .released
            .saturating_sub(self.placed + self.misclassified) as f64;
        self.within_two as f64 >= 0.99 * objects
            && dropped <= 0.005 * objects
            && self.lost == 0
            && self.collisions == 0
            && self.simulated <= 20.0 * objects
            && report.error.is_none()
    }
}

fn tidy_here(
    options: &TableDemoOptions,
    stop: &Stop,
    out: &mut dyn Write,
) -> Result<(TidyReport, Judgement), TableDemoError> {
    let placement = Placement::default().with_count(options.objects);
    let (report, end) = with_table(options, &placement, NAME, out, |network| {
        tidy_on(network, "", options, stop)
    })?;
    let mut judgement = Judgement::of(&end.scene, &report);
    judgement.simulated = end.simulated;
    judgement.collisions = end.collisions;
    judgement.lost_frames = end.lost_frames;
    judgement.wall = end.wall;
    Ok((report, judgement))
}

/// Tidies a table that is somewhere on the network.
fn tidy_on(
    network: &Network,
    prefix: &str,
    options: &TableDemoOptions,
    stop: &Stop,
) -> Result<TidyReport, TableDemoError> {
    let (mut picker, mut detector) = connect(network, prefix, options, stop)?;
    let _display = show_task(&mut picker, network, NAME);
    Ok(tidy(
        &mut picker,
        detector.as_mut(),
        &TidyOptions::default(),
    ))
}
