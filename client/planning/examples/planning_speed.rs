//! Measures planning on random problems: `cargo run -p yarp-planning --example planning_speed -- SEED COUNT SEARCHES SHORTCUTS`.

use std::time::Instant;

use yarp_planning::{PlannerOptions, Problem};

fn main() {
    let mut words = std::env::args()
        .skip(1)
        .filter_map(|word| word.parse::<u64>().ok());
    let (seed, count) = (words.next().unwrap_or(1), words.next().unwrap_or(100));
    let (searches, shortcuts) = (words.next().unwrap_or(1), words.next().unwrap_or(60));
    let mut times = Vec::new();
    let (mut solved, mut length) = (0, 0.0);
    for index in 0..count {
        let problem = Problem::random(seed, index);
        let mut options = PlannerOptions::default();
        options.searches = searches as usize;
        options.shortcuts = shortcuts as usize;
        // The same seed gives the same plan: the fastest of three runs is the one that nothing interrupted.
        let run = || {
            let mut planner = problem.planner().with_options(options.clone());
            let start = Instant::now();
            let path = planner.plan(&problem.start, &problem.goals);
            (start.elapsed().as_secs_f64() * 1e3, path)
        };
        let (time, path) = [run(), run(), run()]
            .into_iter()
            .min_by(|one, other| one.0.total_cmp(&other.0))
            .expect("three runs");
        times.push(time);
        match path {
            Ok(path) => {
                solved += 1;
                length += path.length();
            }
            Err(error) => println!("{index}: {error}, {:.1} ms", times[times.len() - 1]),
        }
    }
    times.sort_by(f64::total_cmp);
    let at = |part: f64| times[((times.len() as f64 * part) as usize).min(times.len() - 1)];
    println!(
        "{solved} of {count} solved; p50 {:.3} ms, p99 {:.3} ms, most {:.3} ms; {:.3} rad",
        at(0.5),
        at(0.99),
        at(1.0),
        length / f64::from(solved.max(1))
    );
}
