//! Well-formed XML yields the same tree as a strict parser, and only what that parser refuses has lints.

use proptest::prelude::*;
use roxmltree::{Document, Node};

use super::{XmlElement, is_white, parse};

/// Pieces of XML; each is well-formed content of an element, or one end of an element.
const PIECES: [&str; 16] = [
    "<a>",
    "</a>",
    "<b c=\"1\" d='x y'>",
    "</b>",
    "<e\n/>",
    "<e f=\"&lt;&#65;&#x42;'>\"/>",
    "<!-- <a> -->",
    " some  text ",
    "&amp;",
    "é > x",
    "\n",
    "<é.-1/>",
    "\t",
    "<a b=\"\" />",
    "</a >",
    "<b>",
];

/// More pieces, most of which XML does not allow.
const MALFORMED: [&str; 20] = [
    "<c d=1/>",
    "<c d=1 e='2'>",
    "</c>",
    "<c d='1'e='2'/>",
    "<c d='a<b'/>",
    "<c d='a&b'/>",
    "<!-- a -- b -->",
    "<!-- a --->",
    "<?xml version=\"1.0\"?>",
    "<?other?>",
    "<!DOCTYPE r>",
    "<1>",
    "a & b",
    "a ]]> b",
    "<![CDATA[ a & b ]]>",
    "\u{1}",
    "</r>",
    "<r>",
    "\n",
    "x",
];

fn condensed(text: &str) -> Option<String> {
    let words: Vec<_> = text
        .split(is_white)
        .filter(|word| !word.is_empty())
        .collect();
    (!words.is_empty()).then(|| words.join(" "))
}

fn strict(node: Node<'_, '_>) -> XmlElement {
    let attributes = node.attributes();
    let children = node.children().filter(Node::is_element);
    // Blank text is no content.
    let mut content = node.children().filter(|child| {
        !child.is_text() || child.text().is_some_and(|text| condensed(text).is_some())
    });
    let first = content.next().filter(Node::is_text);
    let line = node.document().text_pos_at(node.range().start).row;
    XmlElement {
        name: node.tag_name().name().to_owned(),
        attributes: attributes
            .map(|held| (held.name().into(), held.value().into()))
            .collect(),
        text: first.and_then(|text| condensed(text.text()?)),
        children: children.map(strict).collect(),
        line: line as usize,
    }
}

/// Trims texts, which end with the blank before an `&` otherwise.
fn trimmed(mut element: XmlElement) -> XmlElement {
    element.text = element.text.as_deref().and_then(condensed);
    element.children = element.children.into_iter().map(trimmed).collect();
    element
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(5000))]

    #[test]
    fn well_formed_xml_yields_the_same_tree(pieces in prop::collection::vec(prop::sample::select(&PIECES[..]), 0..9)) {
        let text = format!("<?xml version=\"1.0\"?>\n<!DOCTYPE r>\n<r>{}</r>\n<!-- end -->", pieces.concat());
        let options = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
        if let Ok(document) = Document::parse_with_options(&text, options) {
            let ours = parse(&text, &mut 100);
            prop_assert!(ours.is_ok(), "{text}: {ours:?}");
            let ours = trimmed(ours.unwrap().root);
            prop_assert_eq!(ours, strict(document.root_element()), "{}", text);
        }
    }

    #[test]
    fn what_a_strict_parser_refuses_has_lints(
        begin in prop::sample::select(&["", "\n", "<!DOCTYPE r>", "<!-- -->"][..]),
        pieces in prop::collection::vec(prop_oneof![
            prop::sample::select(&PIECES[..]), prop::sample::select(&MALFORMED[..])
        ], 0..5),
    ) {
        let text = format!("{begin}<r>{}</r>", pieces.concat());
        let options = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
        let strict = Document::parse_with_options(&text, options);
        if let Ok(ours) = parse(&text, &mut 100) {
            prop_assert_eq!(ours.lints.is_empty(), strict.is_ok(), "{}: {:?}, {:?}", text, ours.lints, strict);
        }
    }
}
