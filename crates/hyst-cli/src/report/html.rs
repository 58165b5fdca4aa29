//! HTML pages: frame, sections, paragraphs and tables.

use std::fmt::{Display, Write};

const STYLE: &str = include_str!("../../assets/report/style.css");
/// Scripts that draw the plots, in the order in which they use each other.
const SCRIPTS: [&str; 5] = [
    include_str!("../../assets/report/scales.js"),
    include_str!("../../assets/report/curves.js"),
    include_str!("../../assets/report/drawing.js"),
    include_str!("../../assets/report/gestures.js"),
    include_str!("../../assets/report/plots.js"),
];

/// Escapes text for HTML.
pub(crate) fn escaped(text: impl Display) -> String {
    let text = text.to_string();
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            c => safe.push(c),
        }
    }
    safe
}

/// Escapes JSON for a script element: without `<` it can neither end the element nor begin a comment.
pub(crate) fn inlined(json: &str) -> String {
    json.replace('<', "\\u003c").replace('\u{2028}', "\\u2028").replace('\u{2029}', "\\u2029")
}

/// Returns a sentence as HTML, with a capital letter at its start and a full stop at its end.
pub(crate) fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|c| c.to_uppercase().to_string()).unwrap_or_default();
    let stop = if text.ends_with(['.', '!', '?', ':']) { "" } else { "." };
    escaped(format!("{first}{}{stop}", letters.as_str()))
}

/// A page that is being written.
pub(crate) struct Page {
    title: String,
    body: String,
    sections: Vec<(&'static str, &'static str)>,
}

impl Page {
    pub(crate) fn new(title: &str) -> Self {
        Self { title: title.into(), body: String::new(), sections: Vec::new() }
    }

    /// Adds HTML unchanged.
    pub(crate) fn raw(&mut self, html: &str) {
        self.body.push_str(html);
        self.body.push('\n');
    }

    /// Adds a paragraph of text.
    pub(crate) fn paragraph(&mut self, class: &str, text: &str) {
        let class = if class.is_empty() { String::new() } else { format!(" class=\"{class}\"") };
        self.raw(&format!("<p{class}>{}</p>", sentence(text)));
    }

    /// Adds a list of sentences.
    pub(crate) fn list<S: AsRef<str>>(&mut self, sentences: &[S]) {
        let items: String = sentences.iter().map(|s| format!("<li>{}</li>\n", sentence(s.as_ref()))).collect();
        if !items.is_empty() {
            self.raw(&format!("<ul>\n{items}</ul>"));
        }
    }

    /// Starts a section.
    pub(crate) fn section(&mut self, id: &'static str, heading: &'static str) {
        self.sections.push((id, heading));
        self.raw(&format!("<h2 id=\"{id}\">{}</h2>", escaped(heading)));
    }

    /// Adds a command to copy.
    pub(crate) fn command(&mut self, line: &str) {
        self.raw(&format!("<pre><code>{}</code></pre>", escaped(line)));
    }

    /// Adds a table, which scrolls if the screen is too narrow.
    pub(crate) fn table(&mut self, table: &Table) {
        self.raw(&table.html());
    }

    /// Returns the complete file; `data` is the JSON of the plots.
    pub(crate) fn finish(self, data: &str) -> serde_json::Result<String> {
        let title = escaped(&self.title);
        let links: String = self
            .sections
            .iter()
            .map(|(id, name)| format!("<li><a href=\"#{id}\">{}</a></li>", escaped(name)))
            .collect();
        let scripts: String = SCRIPTS.iter().map(|script| format!("<script>\n{script}</script>\n")).collect();
        // Order: title, summary, links to the sections, sections. The sections start at the first heading.
        let begin = self.body.find("<h2").unwrap_or(self.body.len());
        let (summary, sections) = self.body.split_at(begin);
        let mut html = String::with_capacity(self.body.len() + data.len() + scripts.len() + 20_000);
        // Writing to a String does not fail.
        let _ = write!(
            html,
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
            <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
            <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src 'unsafe-inline'; \
            style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'\">\n\
            <meta name=\"generator\" content=\"hystctl {version}\">\n\
            <link rel=\"icon\" href=\"data:,\">\n<title>{title}</title>\n\
            <style>{STYLE}</style>\n</head>\n<body>\n<main>\n\
            <h1>{title}</h1>\n{summary}<nav aria-label=\"Sections\"><ul>{links}</ul></nav>\n{sections}</main>\n\
            <script type=\"application/json\" id=\"pictures\">{data}</script>\n\
            {scripts}</body>\n</html>\n",
            version = env!("CARGO_PKG_VERSION"),
            data = inlined(data),
        );
        Ok(html)
    }
}

/// A table; its first column has the names of the rows.
#[derive(Default)]
pub(crate) struct Table {
    caption: String,
    head: Vec<(String, bool)>,
    rows: Vec<(bool, Vec<String>)>,
}

impl Table {
    pub(crate) fn new(caption: &str) -> Self {
        Self { caption: escaped(caption), ..Self::default() }
    }

    /// Adds a column of words.
    pub(crate) fn words(mut self, heading: &str) -> Self {
        self.head.push((escaped(heading), false));
        self
    }

    /// Adds a column of numbers.
    pub(crate) fn numbers(mut self, heading: &str) -> Self {
        self.head.push((escaped(heading), true));
        self
    }

    /// Adds a row of text.
    pub(crate) fn row<S: AsRef<str>>(&mut self, cells: &[S]) {
        self.rows.push((false, cells.iter().map(|c| escaped(c.as_ref())).collect()));
    }

    /// Adds a highlighted row of text.
    pub(crate) fn named_row<S: AsRef<str>>(&mut self, cells: &[S]) {
        self.row(cells);
        if let Some(last) = self.rows.last_mut() {
            last.0 = true;
        }
    }

    /// Adds a row of text and a bar; `share` is the length of the bar over the width of its column.
    pub(crate) fn bar_row(&mut self, cells: &[&str], share: f64) {
        self.row(cells);
        if let Some((_, cells)) = self.rows.last_mut() {
            let percent = 100.0 * share.clamp(0.0, 1.0);
            cells.push(format!("<span style=\"width:{percent:.1}%\"></span>"));
        }
    }

    /// Adds a row of text and a last cell with HTML.
    pub(crate) fn linked_row<S: AsRef<str>>(&mut self, cells: &[S], link: &str) {
        self.row(cells);
        if let Some((_, cells)) = self.rows.last_mut() {
            cells.push(link.to_owned());
        }
    }

    /// Returns the table as HTML.
    pub(crate) fn html(&self) -> String {
        let class = |number: bool| if number { " class=\"number\"" } else { "" };
        let head: String =
            self.head.iter().map(|(name, number)| format!("<th scope=\"col\"{}>{name}</th>", class(*number))).collect();
        let mut rows = String::new();
        for (named, cells) in &self.rows {
            rows.push_str(if *named { "<tr class=\"named\">" } else { "<tr>" });
            for (i, cell) in cells.iter().enumerate() {
                // Writing to a String does not fail.
                let _ = match (i, self.head.get(i)) {
                    (0, _) => write!(rows, "<th scope=\"row\">{cell}</th>"),
                    (_, Some((_, number))) => write!(rows, "<td{}>{cell}</td>", class(*number)),
                    (_, None) => write!(rows, "<td class=\"bar\" aria-hidden=\"true\">{cell}</td>"),
                };
            }
            rows.push_str("</tr>\n");
        }
        let caption =
            if self.caption.is_empty() { String::new() } else { format!("<caption>{}</caption>", self.caption) };
        // The bars repeat a number of the row, so their column has no heading.
        let bars = self.rows.iter().any(|(_, cells)| cells.len() > self.head.len());
        let bar = if bars { "<td aria-hidden=\"true\"></td>" } else { "" };
        let label = if self.caption.is_empty() { "Table" } else { &self.caption };
        format!(
            "<div class=\"scroll\" role=\"region\" tabindex=\"0\" aria-label=\"{label}\"><table>{caption}\n<thead><tr>{head}{bar}</tr></thead>\n\
            <tbody>\n{rows}</tbody></table></div>"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_and_data_are_escaped() {
        let mut page = Page::new("</title><script>alert(1)</script>");
        page.paragraph("", "<img src=x>");
        page.section("a", "A");
        let mut table = Table::new("c").words("<b>").numbers("n");
        table.row(&["\"x'", "1 & 2"]);
        page.table(&table);
        let html = page.finish(r#"[{"name":"</script><script>alert(2)</script><!--"}]"#).unwrap();
        for bad in ["<script>alert", "<img", "<b>", "</script><script>alert", "<!--"] {
            assert!(!html.contains(bad), "{bad}");
        }
        assert!(html.contains(r#"[{"name":"\u003c/script>\u003cscript>alert(2)\u003c/script>\u003c!--"}]"#));
        assert!(html.contains("<td class=\"number\">1 &amp; 2</td>"));
    }

    #[test]
    fn sentences_get_a_capital_and_a_full_stop() {
        assert_eq!(sentence("explained: a & b"), "Explained: a &amp; b.");
        assert_eq!(["Is it?", "Is it:"].map(sentence), ["Is it?", "Is it:"]);
    }
}
