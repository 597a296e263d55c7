//! The answer to `[pray]`, an old joke that stock's ports know.

use std::hash::{BuildHasher, RandomState};

/// The possible answers, a line each; words in angle brackets are placeholders.
const OUTCOMES: [&[&str]; 10] = [
    &["You feel that <god> is <displeased>."],
    &["<voice> \"Thou <hast>, <creature>. Thou must relearn thy lessons!\""],
    &["<voice> \"Thou hast angered me.\""],
    &[
        "<voice> \"Thou hast angered me.\"",
        "A black glow surrounds you.",
    ],
    &[
        "<voice> \"Thou hast angered me.\"",
        "Suddenly, a bolt of lightning strikes you!",
        "You fry to a crisp!",
    ],
    &["<voice> \"Thou durst call upon me? Then die, <creature>!\""],
    &["You feel that <god> is <pleased>.", "You feel much better."],
    &[
        "You feel that <god> is <pleased>.",
        "Your surroundings change.",
    ],
    &[
        "You feel that <god> is <pleased>.",
        "Your eyes feel better.",
    ],
    &[
        "You feel that <god> is <pleased>.",
        "Your <item> softly glows <aura>.",
    ],
];

/// The replacements of the placeholders; earlier ones may contain later ones.
const WORDS: [(&str, &[&str]); 8] = [
    (
        "<voice>",
        &[
            "The voice of <god> booms out:",
            "The voice of <god> thunders:",
            "The voice of <god> rings out:",
            "The voice of <god> booms:",
        ],
    ),
    ("<displeased>", &["bummed", "displeased"]),
    (
        "<pleased>",
        &[
            "pleased as punch",
            "well-pleased",
            "ticklish",
            "pleased",
            "satisfied",
        ],
    ),
    ("<hast>", &["hast strayed from the path", "art arrogant"]),
    ("<creature>", &["mortal", "creature", "robot"]),
    ("<item>", &["keyboard", "mouse", "monitor", "headphones"]),
    ("<aura>", &["amber", "light blue", "golden", "white"]),
    ("<god>", &[]),
];

/// Returns the lines of an answer; the god is the robot, else the first word of the name of the port.
pub(super) fn pray(port: &str) -> Vec<String> {
    let god = std::env::var("YARP_ROBOT_NAME").unwrap_or_else(|_| {
        let name = port.trim_start_matches('/');
        name.split('/').next().unwrap_or_default().to_owned()
    });
    let mut lines = vec![
        format!("You begin praying to {god}."),
        "You finish your prayer.".to_owned(),
    ];
    for line in *any(&OUTCOMES) {
        let mut line = (*line).to_owned();
        for (word, choices) in WORDS {
            let choice = match choices {
                [] => god.as_str(),
                choices => any(choices),
            };
            line = line.replace(word, choice);
        }
        lines.push(line);
    }
    lines
}

/// One of these, by chance.
fn any<T>(choices: &[T]) -> &T {
    let chance = RandomState::new().hash_one(0) as usize;
    &choices[chance % choices.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_word_of_every_outcome_is_known() {
        for _ in 0..500 {
            for line in pray("/icub/head") {
                assert!(!line.contains(['<', '>']), "{line}");
            }
        }
    }
}
