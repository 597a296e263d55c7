//! Torque commands on their way to the motors.

/// Number of commands that can be on their way: eight periods' worth. The oldest of more takes effect at once.
const CAPACITY: usize = 8;

/// Commands of `N` motors that take effect after a delay.
#[derive(Clone, Debug)]
pub(super) struct CommandDelay<const N: usize> {
    in_effect: [f64; N],
    pending: [Pending<N>; CAPACITY],
    count: usize,
}

#[derive(Clone, Copy, Debug)]
struct Pending<const N: usize> {
    /// Time until it takes effect, s.
    due: f64,
    commands: [f64; N],
}

impl<const N: usize> CommandDelay<N> {
    /// Motors without a command.
    pub(super) fn new() -> Self {
        let none = Pending {
            due: 0.0,
            commands: [0.0; N],
        };
        Self {
            in_effect: [0.0; N],
            pending: [none; CAPACITY],
            count: 0,
        }
    }

    /// Sends commands that take effect after `delay` seconds, and never before those that were sent earlier.
    pub(super) fn send(&mut self, commands: [f64; N], delay: f64) {
        let earlier = self.pending[..self.count].last();
        let due = earlier.map_or(delay, |earlier| delay.max(earlier.due));
        if due <= 0.0 {
            self.in_effect = commands;
            self.count = 0;
            return;
        }
        if self.count == CAPACITY {
            self.take_first();
        }
        self.pending[self.count] = Pending { due, commands };
        self.count += 1;
    }

    /// Lets time pass, and returns the mean of the commands that are in effect meanwhile: its effect on the speed of a
    /// motor is exact, however long the time is.
    pub(super) fn advance(&mut self, seconds: f64) -> [f64; N] {
        if self.count == 0 {
            return self.in_effect;
        }
        let mut mean = [0.0; N];
        let mut passed = 0.0;
        while passed < seconds {
            let due = self.pending[..self.count].first().map(|next| next.due);
            let until = due.map_or(seconds, |due| due.clamp(passed, seconds));
            for (mean, command) in mean.iter_mut().zip(&self.in_effect) {
                *mean += command * (until - passed) / seconds;
            }
            passed = until;
            if due.is_some_and(|due| due <= seconds) {
                self.take_first();
            }
        }
        for pending in &mut self.pending[..self.count] {
            pending.due -= seconds;
        }
        mean
    }

    fn take_first(&mut self) {
        self.in_effect = self.pending[0].commands;
        self.pending.rotate_left(1);
        self.count -= 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_take_effect_in_order_after_their_delay() {
        let mut delay = CommandDelay::<1>::new();
        delay.send([1.0], 0.003);
        assert_eq!(delay.advance(0.002), [0.0]);
        // An earlier arrival does not overtake.
        delay.send([5.0], 0.0);
        let [mean] = delay.advance(0.002);
        assert!((mean - 2.5).abs() < 1e-12, "{mean}");
        assert_eq!(delay.advance(0.002), [5.0]);
        delay.send([7.0], 0.0);
        assert_eq!(delay.advance(0.002), [7.0]);
    }

    #[test]
    fn more_commands_than_there_is_room_for_push_out_the_oldest() {
        let mut delay = CommandDelay::<1>::new();
        for command in 1..=CAPACITY + 2 {
            delay.send([command as f64], 1.0);
        }
        assert_eq!(delay.advance(0.5), [2.0]);
        delay.advance(0.5);
        assert_eq!(delay.advance(0.5), [(CAPACITY + 2) as f64]);
    }
}
