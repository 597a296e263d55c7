//! Parses XML as TinyXML 2.6 does, the parser of stock's `yarprobotinterface`.
//!
//! Descriptions in use are often not well-formed. The differences from XML:
//! * Names have no namespaces: `xi:include` is a name, with or without a declaration of `xi`.
//! * Attribute values may be unquoted, and may contain `<` and `>`; attributes need no blank between them.
//! * A comment ends at the first `-->`.
//! * XML declarations, document types and tags that do not begin with a name are passed over, wherever they are.
//! * Content after the root element is passed over.
//! * A run of white space in a text is one blank, also inside quotes; that of attributes stays.
//! * An `&` that begins no entity is dropped. There are only the five entities of XML, and numbers.
//!
//! Each such difference in a document is listed in [`XmlDocument::lints`], namespaces excepted.
//!
//! The parser does not recurse, and the memory it needs is bounded by the length of the text.

/// Maximum depth of nested elements.
const MAX_ELEMENT_DEPTH: usize = 100;
/// Maximum number of attributes of an element.
const MAX_ATTRIBUTES: usize = 1000;
/// Maximum number of lints of a document; later ones are not listed.
const MAX_LINTS: usize = 200;
const ENTITIES: [(&str, char); 5] = [
    ("&amp;", '&'),
    ("&lt;", '<'),
    ("&gt;", '>'),
    ("&quot;", '"'),
    ("&apos;", '\''),
];

/// An XML document.
#[derive(Debug)]
pub(crate) struct XmlDocument {
    /// Root element.
    pub(crate) root: XmlElement,
    /// Tags before, between and after elements that are passed over, as document types: line and content.
    pub(crate) unknown: Vec<(usize, String)>,
    /// What XML does not allow: line and description.
    pub(crate) lints: Vec<(usize, String)>,
}

/// An element.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct XmlElement {
    /// Name, with its prefix.
    pub(crate) name: String,
    /// Attributes in order; names are unique.
    pub(crate) attributes: Vec<(String, String)>,
    /// Text at the beginning, before any element or comment.
    pub(crate) text: Option<String>,
    /// Elements inside.
    pub(crate) children: Vec<XmlElement>,
    /// Line of the opening `<`, from 1.
    pub(crate) line: usize,
}

/// Error in a document.
#[derive(Debug, PartialEq)]
pub(crate) struct XmlError {
    /// Line, from 1.
    pub(crate) line: usize,
    /// Description.
    pub(crate) what: String,
}

/// Parses a document; `budget` is the number of elements that may still be created, and is decreased.
///
/// Errors: [`XmlError`] for an element or a comment that is not closed, a wrong closing tag, an attribute
/// without a value or given twice, no element at all, too many elements, and elements nested too deeply.
pub(crate) fn parse(text: &str, budget: &mut usize) -> Result<XmlDocument, XmlError> {
    let whole = text.replace("\r\n", "\n").replace('\r', "\n");
    // A C string ends there.
    let text = whole.split('\0').next().unwrap_or_default();
    let mut parser = Parser {
        text,
        at: 0,
        line: 1,
        budget,
        lints: Vec::new(),
    };
    let mut document = parser.document()?;
    document.lints = parser.lints;
    let mut place = (1, 0);
    for (at, _) in whole.match_indices(is_forbidden).take(MAX_LINTS) {
        place = (place.0 + whole[place.1..at].matches('\n').count(), at);
        let code = u32::from(whole.as_bytes()[at]);
        let what = match code {
            0 => "a NUL character: nothing after it is read".to_owned(),
            _ => format!("control character {code} is not allowed"),
        };
        document.lints.push((place.0, what));
        if code == 0 {
            break;
        }
    }
    Ok(document)
}

struct Parser<'t, 'b> {
    text: &'t str,
    /// Position, always at the beginning of a character.
    at: usize,
    line: usize,
    budget: &'b mut usize,
    lints: Vec<(usize, String)>,
}

/// An element whose end is not read yet.
struct OpenElement {
    element: XmlElement,
    /// True if something was read inside it.
    has_content: bool,
}

impl<'t> Parser<'t, '_> {
    fn document(&mut self) -> Result<XmlDocument, XmlError> {
        let mut root = None;
        let mut unknown = Vec::new();
        loop {
            self.skip_white_space();
            let line = self.line;
            let rest = self.rest();
            if !rest.starts_with('<') {
                // The end, or text outside of elements: nothing after it is read.
                if !rest.is_empty() {
                    self.lint("text after the root element: nothing after it is read");
                }
                break;
            } else if begins_element(rest) {
                if root.is_some() {
                    self.lint("an element after the root element is passed over");
                }
                let element = self.element()?;
                root.get_or_insert(element);
            } else {
                match self.pass_over() {
                    Ok(tag) => {
                        let is_type = tag.is_some_and(|tag| tag.starts_with("!DOCTYPE"));
                        let known = |(_, tag): &(usize, String)| tag.starts_with("!DOCTYPE");
                        if is_type && (root.is_some() || unknown.iter().any(known)) {
                            self.lint("a document type has to be before the root element, once");
                        }
                        unknown.extend(tag.map(|tag| (line, tag.to_owned())));
                    }
                    // Stock does not mind what is not closed after the root element.
                    Err(error) if root.is_some() => {
                        self.lint(format!("after the root element: {}", error.what));
                        break;
                    }
                    Err(error) => return Err(error),
                }
            }
        }
        match root {
            Some(root) => Ok(XmlDocument {
                root,
                unknown,
                lints: Vec::new(),
            }),
            None => Err(self.error("there is no element")),
        }
    }

    /// Reads an element and everything inside.
    fn element(&mut self) -> Result<XmlElement, XmlError> {
        let mut open: Vec<OpenElement> = Vec::new();
        loop {
            let (element, is_empty) = self.tag(open.len())?;
            let mut done = match is_empty {
                true => Some(element),
                false => {
                    open.push(OpenElement {
                        element,
                        has_content: false,
                    });
                    None
                }
            };
            // Close elements until the next one begins.
            loop {
                if let Some(element) = done.take() {
                    match open.last_mut() {
                        None => return Ok(element),
                        Some(parent) => parent.element.children.push(element),
                    }
                }
                let Some(last) = open.last_mut() else {
                    return Err(self.error("there is no element"));
                };
                if self.content(last)? {
                    break;
                }
                done = open.pop().map(|closed| closed.element);
            }
        }
    }

    /// Reads the content of an element up to the next element inside (true) or its end (false).
    fn content(&mut self, open: &mut OpenElement) -> Result<bool, XmlError> {
        loop {
            self.skip_white_space();
            let rest = self.rest();
            if rest.is_empty() {
                let (name, line) = (&open.element.name, open.element.line);
                return Err(self.error(format!("<{name}> of line {line} is not closed")));
            }
            let is_first = !open.has_content;
            if rest.starts_with("</") {
                self.closing_tag(&open.element)?;
                return Ok(false);
            }
            open.has_content = true;
            if !rest.starts_with('<') {
                let text = self.text()?;
                if text.trim_matches(is_white).is_empty() {
                    open.has_content = !is_first;
                } else if is_first {
                    open.element.text = Some(text);
                }
            } else if let Some(inside) = rest.strip_prefix("<![CDATA[") {
                let Some(length) = inside.find("]]>") else {
                    return Err(self.error("<![CDATA[ is not closed, expected ]]>"));
                };
                if is_first {
                    open.element.text = Some(inside[..length].to_owned());
                }
                self.advance("<![CDATA[".len() + length + "]]>".len());
            } else if begins_element(rest) {
                return Ok(true);
            } else {
                if rest.starts_with("<!DOCTYPE") {
                    self.lint("a document type has to be before the root element, once");
                }
                self.pass_over()?;
            }
        }
    }

    /// Reads an opening tag; returns true for one that closes itself.
    fn tag(&mut self, depth: usize) -> Result<(XmlElement, bool), XmlError> {
        if depth >= MAX_ELEMENT_DEPTH {
            let what = format!("elements are nested more than {MAX_ELEMENT_DEPTH} levels deep");
            return Err(self.error(what));
        }
        let Some(left) = self.budget.checked_sub(1) else {
            return Err(self.error("too many elements"));
        };
        *self.budget = left;
        let line = self.line;
        self.advance(1);
        let mut element = XmlElement {
            name: self.name().to_owned(),
            line,
            ..XmlElement::default()
        };
        loop {
            self.skip_white_space();
            let rest = self.rest();
            if rest.starts_with('>') {
                self.advance(1);
                return Ok((element, false));
            }
            if rest.starts_with("/>") {
                self.advance(2);
                return Ok((element, true));
            }
            let name = self.name();
            if name.is_empty() {
                let expected = "an attribute, > or />";
                return Err(self.unexpected(expected, &element.name));
            }
            self.skip_white_space();
            if !self.rest().starts_with('=') {
                let expected = format!("= and a value after {name}");
                return Err(self.unexpected(&expected, &element.name));
            }
            self.advance(1);
            self.skip_white_space();
            let value = self.value(&element.name, name)?;
            if self.rest().starts_with(begins_name) {
                self.lint(format!("no blank after the value of attribute {name}"));
            }
            if element.attributes.iter().any(|(known, _)| known == name) {
                let what = format!("attribute {name} occurs twice in <{}>", element.name);
                return Err(self.error(what));
            }
            if element.attributes.len() == MAX_ATTRIBUTES {
                let name = &element.name;
                return Err(
                    self.error(format!("more than {MAX_ATTRIBUTES} attributes in <{name}>"))
                );
            }
            element.attributes.push((name.to_owned(), value));
        }
    }

    /// Reads the value of an attribute, quoted or up to the next blank, `/` or `>`.
    fn value(&mut self, element: &str, attribute: &str) -> Result<String, XmlError> {
        let rest = self.rest();
        if let Some(quote) = rest.chars().next().filter(|c| matches!(c, '"' | '\'')) {
            let Some(length) = rest[1..].find(quote) else {
                return Err(self.error(format!("{quote} is not closed in <{element}>")));
            };
            if rest[1..=length].contains('<') {
                self.lint(format!("expected &lt; in attribute {attribute}, got <"));
            }
            let value = self.decode(&rest[1..=length], false)?;
            self.advance(length + 2);
            return Ok(value);
        }
        let ends = |c: char| is_white(c) || matches!(c, '/' | '>' | '"' | '\'');
        let length = rest.find(ends).unwrap_or(rest.len());
        self.lint(format!("the value of attribute {attribute} is not quoted"));
        self.advance(length);
        match self.rest().chars().next() {
            None => Err(self.error(format!("<{element} is not closed, expected >"))),
            Some('"' | '\'') => Err(self.unexpected("a quote at both ends of a value", element)),
            Some(_) => Ok(rest[..length].to_owned()),
        }
    }

    fn closing_tag(&mut self, element: &XmlElement) -> Result<(), XmlError> {
        let rest = self.rest();
        let inside = rest[2..].strip_prefix(element.name.as_str());
        let end = inside.map(|rest| rest.trim_start_matches(is_white));
        match end.and_then(|end| end.strip_prefix('>')) {
            Some(after) => {
                self.advance(rest.len() - after.len());
                Ok(())
            }
            None => {
                let (name, line) = (&element.name, element.line);
                Err(self.unexpected(&format!("</{name}> (opened in line {line})"), name))
            }
        }
    }

    /// Reads text up to the next `<`.
    fn text(&mut self) -> Result<String, XmlError> {
        let rest = self.rest();
        let length = rest.find('<').unwrap_or(rest.len());
        if rest[..length].contains("]]>") {
            self.lint("expected ]]&gt; in a text, got ]]>");
        }
        let text = self.decode(&rest[..length], true)?;
        self.advance(length);
        Ok(text)
    }

    /// Passes over a comment, a declaration, a document type or anything else between `<` and `>`; returns the
    /// content of the last two.
    fn pass_over(&mut self) -> Result<Option<&'t str>, XmlError> {
        let rest = self.rest();
        if let Some(inside) = rest.strip_prefix("<!--") {
            let Some(length) = inside.find("-->") else {
                return Err(self.error("a comment is not closed, expected -->"));
            };
            if inside[..length].contains("--") || inside[..length].ends_with('-') {
                self.lint("-- inside a comment");
            }
            self.advance("<!--".len() + length + "-->".len());
            return Ok(None);
        }
        let Some(length) = rest.find('>') else {
            return Err(self.error("< is not closed, expected >"));
        };
        self.lint_passed_over(&rest[..=length]);
        self.advance(length + 1);
        Ok(Some(&rest[1..length]))
    }

    /// Lists a tag that is passed over, unless XML has it there.
    fn lint_passed_over(&mut self, tag: &str) {
        let is_declaration = tag
            .strip_prefix("<?xml")
            .is_some_and(|rest| rest.starts_with(|c| is_white(c) || c == '?'));
        let starts = self.at == 0 || self.text[..self.at] == *"\u{feff}";
        if is_declaration && !starts {
            self.lint("an XML declaration has to be at the beginning of the file");
        } else if !tag.starts_with("<?") && !tag.starts_with("<!DOCTYPE") {
            let shown: String = tag.chars().take(20).collect();
            self.lint(format!(
                "expected a name after <, got {shown:?}: the tag is passed over"
            ));
        }
    }

    /// Replaces entities, and white space if `condense`.
    fn decode(&mut self, mut text: &str, condense: bool) -> Result<String, XmlError> {
        let mut out = String::with_capacity(text.len());
        let (mut blank, mut started) = (false, false);
        while let Some(first) = text.chars().next() {
            if condense && is_white(first) {
                blank = started;
                text = &text[first.len_utf8()..];
                continue;
            }
            started = true;
            if std::mem::take(&mut blank) {
                out.push(' ');
            }
            if first != '&' {
                out.push(first);
                text = &text[first.len_utf8()..];
            } else if text.starts_with("&#") {
                let (character, rest) = numeric_entity(text)
                    .ok_or_else(|| self.error("expected a number and ; after &#"))?;
                out.push(character);
                text = rest;
            } else {
                let known = ENTITIES.iter().find(|(name, _)| text.starts_with(name));
                if known.is_none() {
                    self.lint("expected &amp; or another entity, got &, which is dropped");
                }
                out.extend(known.map(|(_, character)| *character));
                text = &text[known.map_or(1, |(name, _)| name.len())..];
            }
        }
        Ok(out)
    }

    /// Reads a name; empty if there is none.
    fn name(&mut self) -> &'t str {
        let rest = self.rest();
        if !rest.starts_with(begins_name) {
            return "";
        }
        let inside = |c: char| begins_name(c) || c.is_ascii_digit() || matches!(c, '-' | '.' | ':');
        let length = rest.find(|c| !inside(c)).unwrap_or(rest.len());
        self.at += length;
        &rest[..length]
    }

    fn rest(&self) -> &'t str {
        &self.text[self.at..]
    }

    fn advance(&mut self, bytes: usize) {
        let passed = &self.text.as_bytes()[self.at..self.at + bytes];
        self.line += passed.iter().filter(|byte| **byte == b'\n').count();
        self.at += bytes;
    }

    fn skip_white_space(&mut self) {
        let rest = self.rest();
        self.advance(rest.len() - rest.trim_start_matches(is_white).len());
    }

    fn lint(&mut self, what: impl Into<String>) {
        if self.lints.len() < MAX_LINTS {
            self.lints.push((self.line, what.into()));
        }
    }

    fn error(&self, what: impl Into<String>) -> XmlError {
        XmlError {
            line: self.line,
            what: what.into(),
        }
    }

    fn unexpected(&self, expected: &str, element: &str) -> XmlError {
        let found: String = self.rest().chars().take(20).collect();
        let found = match found.as_str() {
            "" => "the end of the file".to_owned(),
            found => format!("{found:?}"),
        };
        self.error(format!("expected {expected} in <{element}>, got {found}"))
    }
}

/// Parses `&#65;` or `&#x41;`; returns the character and the text after it.
fn numeric_entity(text: &str) -> Option<(char, &str)> {
    let (number, rest) = text.strip_prefix("&#")?.split_once(';')?;
    let code = match number.strip_prefix('x') {
        Some(hex) => u32::from_str_radix(hex, 16),
        None => number.parse(),
    };
    let character = code.ok().and_then(char::from_u32);
    Some((character.filter(|character| *character != '\0')?, rest))
}

fn begins_element(rest: &str) -> bool {
    rest.strip_prefix('<')
        .is_some_and(|name| name.starts_with(begins_name))
}

fn begins_name(c: char) -> bool {
    c.is_ascii_alphabetic() || c == '_' || (c >= '\x7f' && !is_white(c))
}

/// Returns true for a character that no XML document may contain.
fn is_forbidden(c: char) -> bool {
    c < ' ' && !matches!(c, '\t' | '\n' | '\r')
}

fn is_white(c: char) -> bool {
    matches!(c, ' ' | '\t'..='\r' | '\u{feff}')
}

#[cfg(test)]
mod tolerant_xml_tests;
