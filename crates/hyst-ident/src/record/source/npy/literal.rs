//! Python literals, which the header of an NPY file consists of.

/// Deepest nesting of literals. Headers have four to six levels.
const MAX_DEPTH: usize = 32;

/// A literal.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Literal {
    Text(String),
    Integer(u64),
    Bool(bool),
    None,
    /// A tuple or a list.
    List(Vec<Self>),
    Dictionary(Vec<(Self, Self)>),
}

impl Literal {
    /// Parses the literal at the start of `text`.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        Parser { rest: text }.literal(MAX_DEPTH)
    }

    /// Returns the value of a key of a dictionary.
    pub(crate) fn get(&self, key: &str) -> Option<&Self> {
        let Self::Dictionary(pairs) = self else { return None };
        pairs.iter().find(|(own, _)| own.text() == Some(key)).map(|(_, value)| value)
    }

    pub(crate) fn text(&self) -> Option<&str> {
        if let Self::Text(text) = self { Some(text) } else { None }
    }

    pub(crate) fn list(&self) -> Option<&[Self]> {
        if let Self::List(list) = self { Some(list) } else { None }
    }

    pub(crate) fn integer(&self) -> Option<usize> {
        if let Self::Integer(integer) = self { usize::try_from(*integer).ok() } else { None }
    }
}

struct Parser<'a> {
    rest: &'a str,
}

impl Parser<'_> {
    /// Skips blanks and then `token`. Returns false if `token` is not next.
    fn eat(&mut self, token: &str) -> bool {
        self.rest = self.rest.trim_start();
        let Some(rest) = self.rest.strip_prefix(token) else { return false };
        self.rest = rest;
        true
    }

    fn literal(&mut self, depth: usize) -> Option<Literal> {
        let depth = depth.checked_sub(1)?;
        for (open, close) in [("(", ")"), ("[", "]")] {
            if self.eat(open) {
                return self.items(close, |parser| parser.literal(depth)).map(Literal::List);
            }
        }
        if self.eat("{") {
            let pair = |parser: &mut Self| {
                let key = parser.literal(depth)?;
                parser.eat(":").then(|| parser.literal(depth)).flatten().map(|value| (key, value))
            };
            return self.items("}", pair).map(Literal::Dictionary);
        }
        let words = [("True", Literal::Bool(true)), ("False", Literal::Bool(false)), ("None", Literal::None)];
        for (word, literal) in words {
            if self.eat(word) {
                return Some(literal);
            }
        }
        match self.rest.chars().next()? {
            quote @ ('\'' | '"') => self.quoted(quote),
            '0'..='9' => self.integer(),
            _ => None,
        }
    }

    /// Parses items with commas between them, up to `close`.
    fn items<T>(&mut self, close: &str, item: impl Fn(&mut Self) -> Option<T>) -> Option<Vec<T>> {
        let mut items = Vec::new();
        loop {
            if self.eat(close) {
                return Some(items);
            }
            items.push(item(self)?);
            if !self.eat(",") {
                return self.eat(close).then_some(items);
            }
        }
    }

    fn quoted(&mut self, quote: char) -> Option<Literal> {
        let mut text = String::new();
        let mut characters = self.rest[1..].char_indices();
        while let Some((at, character)) = characters.next() {
            if character == quote {
                self.rest = &self.rest[1 + at + 1..];
                return Some(Literal::Text(text));
            }
            text.push(if character == '\\' { characters.next()?.1 } else { character });
        }
        None
    }

    fn integer(&mut self) -> Option<Literal> {
        let end = self.rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(self.rest.len());
        let (digits, rest) = self.rest.split_at(end);
        // Python 2 writes long integers with an L at the end.
        self.rest = rest.strip_prefix('L').unwrap_or(rest);
        digits.parse().ok().map(Literal::Integer)
    }
}
