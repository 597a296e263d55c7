//! The arm of a simulated table: options of `yarp table`, `yarp demo tidy` and `yarp demo reorder`.

use yarp_table::TableArm;

use crate::error::Failure;

#[derive(Clone, Copy, Debug, Eq, PartialEq, clap::ValueEnum)]
enum Simulation {
    /// Has masses, friction, encoders and a controller
    Dynamic,
    /// The same behind the driver of its CAN bus; only at speed 1
    Bus,
    /// Also has latency, noise, cogging, elastic cables and stiction, like a real arm; only at speed 1
    Real,
}

#[derive(Clone, Debug, clap::Args)]
pub(super) struct TableArmArgs {
    /// Type of the simulation of the arm; dynamic by default
    #[arg(long, value_enum)]
    simulation: Option<Simulation>,
    /// Share of the frames that the bus of the arm loses, 0 to 1
    #[arg(long, value_name = "SHARE", requires = "simulation")]
    lost_frames: Option<f64>,
}

impl TableArmArgs {
    /// Returns the arm of a table at this speed, or at its default, and the speed.
    ///
    /// Errors: options that do not fit each other.
    pub(super) fn arm(&self, speed: Option<f64>, default: f64) -> Result<(TableArm, f64), Failure> {
        let refused = |why: &str| Failure::Table(why.into());
        let simulation = self.simulation.unwrap_or(Simulation::Dynamic);
        if simulation == Simulation::Dynamic {
            return match self.lost_frames {
                Some(_) => Err(refused(
                    "--lost-frames needs an arm on a bus: --simulation bus or real",
                )),
                None => Ok((TableArm::Dynamic, speed.unwrap_or(default))),
            };
        }
        if speed.is_some_and(|speed| speed != 1.0) {
            return Err(refused(
                "an arm on its bus runs at --speed 1 only: its driver keeps real time",
            ));
        }
        let arm = TableArm::OnBus {
            effects: simulation == Simulation::Real,
            lost_frames: self.lost_frames.unwrap_or(0.0),
        };
        Ok((arm, 1.0))
    }

    /// Returns whether there are options for the arm of a table that is elsewhere.
    pub(super) fn are_given(&self) -> bool {
        self.simulation.is_some()
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        arm: TableArmArgs,
    }

    fn arm(words: &str, speed: Option<f64>) -> Result<(TableArm, f64), String> {
        let words = std::iter::once("command").chain(words.split_whitespace());
        let command = Command::try_parse_from(words).map_err(|error| error.to_string())?;
        command
            .arm
            .arm(speed, 2.0)
            .map_err(|error| error.to_string())
    }

    #[test]
    fn options_that_do_not_fit_each_other_are_refused() {
        assert_eq!(arm("", None), Ok((TableArm::Dynamic, 2.0)));
        assert_eq!(
            arm("--simulation dynamic", Some(5.0)),
            Ok((TableArm::Dynamic, 5.0))
        );
        let on_bus = |effects, lost_frames| TableArm::OnBus {
            effects,
            lost_frames,
        };
        assert_eq!(arm("--simulation bus", None), Ok((on_bus(false, 0.0), 1.0)));
        let words = "--simulation real --lost-frames 0.1";
        assert_eq!(arm(words, Some(1.0)), Ok((on_bus(true, 0.1), 1.0)));
        assert!(
            arm("--simulation bus", Some(2.0))
                .unwrap_err()
                .contains("--speed 1")
        );
        let words = "--simulation dynamic --lost-frames 0.1";
        assert!(arm(words, None).unwrap_err().contains("--simulation bus"));
        assert!(
            arm("--lost-frames 0.1", None)
                .unwrap_err()
                .contains("--simulation")
        );
    }
}
