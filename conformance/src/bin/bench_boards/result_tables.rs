//! Tables of results.

use crate::arrival_times::Figures;
use crate::background_load::Load;
use crate::state_reader::STATE_PORTS;

/// Results of the thesis.
struct Thesis {
    heading: &'static str,
    /// Index of the load in [`Load::ALL`], and index of the hosts in their list.
    load: usize,
    place: usize,
    rate: f64,
    shortest: f64,
    mean: f64,
    deviation: f64,
    longest: f64,
}

/// Table 6, and the deviations of figure 19, of the thesis: its arm and its clients, with the load
/// of the arm.
const THESIS: [Thesis; 4] = [
    thesis_row("localhost, mild", 0, 1, [49.95, 4.11, 20.02, 0.0321, 33.14]),
    thesis_row(
        "localhost, intensive",
        0,
        2,
        [49.98, 1.47, 20.01, 0.0578, 30.18],
    ),
    thesis_row("two hosts, mild", 1, 1, [50.02, 1.32, 19.99, 0.0791, 25.02]),
    thesis_row(
        "two hosts, intensive",
        1,
        2,
        [50.05, 2.11, 19.98, 0.1692, 29.27],
    ),
];

const fn thesis_row(heading: &'static str, place: usize, load: usize, row: [f64; 5]) -> Thesis {
    let [rate, shortest, mean, deviation, longest] = row;
    Thesis {
        heading,
        load,
        place,
        rate,
        shortest,
        mean,
        deviation,
        longest,
    }
}

/// Prints the results at one rate on one set of hosts: `figures` of a load, a side, and one of
/// [`STATE_PORTS`] or, last, the bare thread.
pub(crate) fn circumstances(
    rate: &str,
    place: &str,
    figures: impl Fn(usize, usize, usize) -> Figures,
) {
    println!();
    println!(
        "{:<34}{:>9}{:>9}{:>9}{:>9}{:>7}{:>8}",
        format!("{rate}, {place}"),
        "mean",
        "sd",
        "p99",
        "worst",
        "lost",
        "count"
    );
    for (l, load) in Load::ALL.iter().enumerate() {
        for (what, feed) in STATE_PORTS.iter().chain(&["bare"]).enumerate() {
            for (side, whose) in ["ours", "stock"].iter().enumerate() {
                let label = match *feed {
                    "bare" => format!("bare, beside {whose}"),
                    feed => format!("{whose} {feed}"),
                };
                let f = figures(l, side, what);
                println!(
                    "{:<12}{label:<22}{:>9.3}{:>9.3}{:>9.3}{:>9.3}{:>7}{:>8}",
                    load.label(),
                    f.mean,
                    f.deviation,
                    f.p99,
                    f.longest,
                    f.lost,
                    f.count
                );
            }
        }
    }
}

/// Prints the positions at 50 Hz beside table 6 of the thesis.
pub(crate) fn thesis(places: usize, figures: impl Fn(usize, usize, usize) -> Figures) {
    println!();
    println!(
        "as Table 6 of the thesis (its load was that of the arm, and its machines were those of 2009): state:o"
    );
    println!(
        "{:<34}{:>9}{:>9}{:>9}{:>9}{:>9}",
        "", "rate/s", "min", "mean", "sd", "max"
    );
    for row in THESIS.iter().filter(|row| row.place < places) {
        let print = |whose: &str, [rate, shortest, mean, deviation, longest]: [f64; 5]| {
            println!(
                "{:<24}{whose:<10}{rate:>9.2}{shortest:>9.2}{mean:>9.3}{deviation:>9.4}{longest:>9.2}",
                row.heading
            );
        };
        print(
            "thesis",
            [row.rate, row.shortest, row.mean, row.deviation, row.longest],
        );
        for (side, whose) in ["ours", "stock"].iter().enumerate() {
            let f = figures(row.place, row.load, side);
            print(
                whose,
                [1e3 / f.mean, f.shortest, f.mean, f.deviation, f.longest],
            );
        }
    }
}
