//! Configuration files: includes, groups, lists, and the origin of each value.

use std::collections::BTreeMap;

use proptest::prelude::*;
use yarp_wire::settings::{NoSource, Origin, Settings, Source};

/// Files that are not there, and variables.
struct Files(BTreeMap<&'static str, &'static str>);

impl Files {
    fn of<const N: usize>(files: [(&'static str, &'static str); N]) -> Self {
        Self(files.into())
    }
}

impl Source for Files {
    fn read(&self, file: &str) -> Option<String> {
        self.0.get(file).map(|text| (*text).to_owned())
    }

    fn list(&self, directory: &str) -> Option<Vec<String>> {
        let inside =
            |file: &&str| Some(file.strip_prefix(directory)?.strip_prefix('/')?.to_owned());
        let names: Vec<_> = self.0.keys().filter_map(inside).collect();
        (!names.is_empty()).then_some(names)
    }

    fn variable(&self, name: &str) -> Option<String> {
        (name == "OUTSIDE").then(|| "there".to_owned())
    }

    fn resource(&self, context: &str, file: &str) -> Option<String> {
        Some(format!("contexts/{context}/{file}"))
    }
}

#[track_caller]
fn check(text: &str, expected: &str) {
    let mut settings = Settings::new();
    settings.read_text("f.ini", text, &NoSource);
    assert_eq!(settings.to_string(), expected, "{text}");
}

/// Each text was read by stock 3.5.0.
#[test]
fn texts_are_read_as_stock_reads_them() {
    check("a 1\nb = 2\nc\nd 1 (2 3)", "(a 1) (b 2) (c) (d 1 (2 3))");
    check("[g]\na 1\nb = 2\n[]\nc 3\n", "(c 3) (g (a 1) (b 2))");
    check("[l a]\nx 1\n[l b]\nx 2\n", "(a (x 1)) (b (x 2)) (l a b)");
    check(
        "[g]\na 1\n[h]\nb 2\n[g]\nc 3\n",
        "(g (a 1) (c 3)) (h (b 2))",
    );
    check("a (1\n2)\nb \"x\ny\"\n", "(a (12)) (b xy)");
    check("a 1\\\n2\n", "(a 12)");
    check("a 1 // b\n# c 1\nd 2 # e\n", "(a 1) (d 2)");
    check("a 1\na 2\n", "(a 2)");
    check("a 5\nb $a ${a}0\n", "(a 5) (b 5 50)");
    check(" [g]\na 1", "(a 1) ([g])");
    check("[g\na 1", "(a 1) (false)");
    check("[g]\n", "(g)");
    check("a (1\nb 2", "(a)");
}

#[test]
fn files_include_files() {
    let files = Files::of([
        (
            "top/main.ini",
            "a $OUTSIDE\n[include part.ini]\n[include grp part.ini]\n[grp]\ny 2\n[include l other sub/o.ini]\n[import ctx c.ini]",
        ),
        ("top/part.ini", "x 1\n[in]\nz 3\n"),
        ("top/sub/o.ini", "o 1\n[include near.ini]\n"),
        ("top/sub/near.ini", "n 1\n"),
        ("contexts/ctx/c.ini", "c 1\n"),
    ]);
    let mut settings = Settings::new();
    let problems = settings.read_file("top/main.ini", &files).unwrap();
    assert_eq!(problems, []);
    let expected = "(a there) (c 1) (grp (in (z 3)) (x 1) (y 2)) (in (z 3)) (l other) (other (n 1) (o 1)) (x 1)";
    assert_eq!(settings.to_string(), expected);
    let origin = |path: &[&str]| {
        let group = settings.group(path[0]).unwrap();
        let inside = path[1..]
            .iter()
            .fold(group, |group, step| group.group(step).unwrap());
        inside.origin().unwrap().to_string()
    };
    assert_eq!(origin(&["x"]), "top/part.ini:1");
    assert_eq!(origin(&["grp", "in", "z"]), "top/part.ini:3");
    assert_eq!(origin(&["grp", "y"]), "top/main.ini:5");
    assert_eq!(origin(&["other", "n"]), "top/sub/near.ini:1");
    assert!(settings.read_file("top/none.ini", &files).is_none());
}

#[test]
fn a_directory_is_all_its_files() {
    let files = Files::of([
        ("d/a.ini", "[g]\nx 1"),
        ("d/b.ini", "y 2\n"),
        ("d/c.txt", "z 3\n"),
    ]);
    let mut settings = Settings::new();
    settings.read_file("d", &files).unwrap();
    assert_eq!(settings.to_string(), "(g (x 1)) (y 2)");
    assert_eq!(settings.origin("y").unwrap().to_string(), "d/b.ini:1");
}

#[test]
fn failed_includes_are_reported() {
    let said = |text: &'static str| {
        let files = Files::of([("f.ini", text)]);
        let problems = Settings::new().read_file("f.ini", &files).unwrap();
        problems.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    assert_eq!(
        said("a 1\n[include none.ini]"),
        ["f.ini:2: cannot read from none.ini"]
    );
    assert_eq!(said("[include a b c d]"), ["f.ini:1: bad include"]);
    // A file that includes itself ends.
    assert!(said("[include f.ini]")[0].contains("16 files deep"));
    assert!(said("[include f.ini]\n[include f.ini]").len() < 2000);
    let deep: &'static str = "(".repeat(1000).leak();
    let closed: &'static str = format!("a {deep}{}", ")".repeat(1000)).leak();
    assert!(said(closed)[0].starts_with("f.ini:1: lists nested deeper"));
}

/// Pieces of which files are made.
fn text() -> impl Strategy<Value = String> {
    let pieces = prop::sample::select(vec![
        "a", "b", " ", "\n", "[", "]", "include", "import", "(", ")", "\"", "\\", "$", "{", "}",
        "//", "#", "=", "1", "--", "::", "\r", "é", "f.ini",
    ]);
    prop::collection::vec(pieces, 0..60).prop_map(|pieces| pieces.concat())
}

proptest! {
    #[test]
    fn no_text_breaks_the_reader(text in text()) {
        let files = Files::of([("f.ini", "x 1\n[include f.ini]")]);
        let mut settings = Settings::new();
        settings.read_text("main", &text, &files);
        // Parsed settings can be parsed again from their printed form.
        Settings::new().add_lists(&settings.to_string(), &Origin::Program).unwrap();
    }

    #[test]
    fn no_words_break_the_command_line(words in prop::collection::vec("(--)?[a:() \"\\\\1]{0,6}", 0..8)) {
        let mut settings = Settings::new();
        settings.add_command_line(&words);
        let _ = settings.to_string();
    }
}
