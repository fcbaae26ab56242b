//! The shell of a page and the blocks it is built of.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::canvas::{LegendEntry, Picture, Swatch};
use crate::palette;
use crate::table::Table;

/// The stylesheet, but for the colours of pictures.
const STYLE: &str = include_str!("style.css");

/// One self-contained HTML page.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Page {
    title: String,
    lead: Vec<String>,
    facts: Vec<(String, String)>,
    sections: Vec<Section>,
    version: String,
}

/// A part of a page under a heading.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Section {
    heading: String,
    blocks: Vec<Block>,
}

/// What a section consists of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Block {
    /// A paragraph.
    Text(String),
    /// Things the reader should know, set off from the rest.
    Notices(Vec<String>),
    /// Key figures beside each other.
    Tiles(Vec<Tile>),
    /// Names with their values.
    Facts(Vec<(String, String)>),
    /// A table.
    Table(Table),
    /// A picture over the full width.
    Figure(Figure),
    /// Pictures in two columns where there is room.
    Gallery(Vec<Figure>),
    /// Two columns, the first twice as wide; below each other where there is no room.
    Columns(Vec<Block>, Vec<Block>),
    /// A part with a heading of its own.
    Group(String, Vec<Block>),
    /// A part that is folded until it is asked for; unfolded in print.
    Details(String, Vec<Block>),
    /// A command to type.
    Command(String),
}

/// A key figure.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Tile {
    /// What it is.
    pub label: String,
    /// The figure with its unit.
    pub value: String,
    /// How to take it.
    pub note: String,
}

/// A picture with its caption, and a table behind it where one is given.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Figure {
    /// The picture.
    pub picture: Picture,
    /// What it shows and how to read it.
    pub caption: String,
    /// The figures it was drawn from, folded.
    pub table: Option<Table>,
}

impl Figure {
    /// A picture with its caption.
    pub fn new(picture: Picture, caption: impl Into<String>) -> Self {
        Self {
            picture,
            caption: caption.into(),
            table: None,
        }
    }

    fn render(&self) -> Markup {
        html! {
            figure {
                @if !self.picture.legend.is_empty() { (legend(&self.picture.legend)) }
                div.picture { (PreEscaped(&self.picture.svg)) }
                figcaption {
                    (self.caption)
                    @if let Some(table) = &self.table {
                        details { summary { "Figures" } (table.render()) }
                    }
                }
            }
        }
    }
}

/// A legend as text above its picture, where it hides no data.
fn legend(entries: &[LegendEntry]) -> Markup {
    html! {
        ul.legend {
            @for entry in entries {
                li {
                    svg viewBox="0 0 22 12" width="22" height="12" aria-hidden="true" {
                        @let colour = format!("var(--{})", entry.ink.name());
                        @match entry.swatch {
                            Swatch::Line => { path d="M1 6H21" stroke-width="2.5" style={"stroke:" (colour)} {} }
                            Swatch::Area => { rect x="1" y="2" width="20" height="8" opacity="0.45" style={"fill:" (colour)} {} }
                            Swatch::Bar => { rect x="1" y="1" width="20" height="10" style={"fill:" (colour)} {} }
                            Swatch::Stroke => { path d="M11 0V12" stroke-width="2.5" style={"stroke:" (colour)} {} }
                        }
                    }
                    (entry.text)
                }
            }
        }
    }
}

impl Section {
    /// A section without content.
    pub fn new(heading: impl Into<String>) -> Self {
        Self {
            heading: heading.into(),
            blocks: Vec::new(),
        }
    }

    /// With one more block.
    #[must_use]
    pub fn with(mut self, block: Block) -> Self {
        self.blocks.push(block);
        self
    }

    /// With a picture, if there is one.
    #[must_use]
    pub fn with_picture(self, picture: Option<Picture>, caption: impl Into<String>) -> Self {
        match picture {
            Some(picture) => self.with(Block::Figure(Figure::new(picture, caption))),
            None => self,
        }
    }
}

impl Block {
    /// Whether there is nothing to see in it.
    fn is_empty(&self) -> bool {
        match self {
            Block::Text(text) | Block::Command(text) => text.is_empty(),
            Block::Notices(list) => list.is_empty(),
            Block::Tiles(tiles) => tiles.is_empty(),
            Block::Facts(facts) => facts.is_empty(),
            Block::Table(table) => table.is_empty(),
            Block::Figure(_) => false,
            Block::Gallery(figures) => figures.is_empty(),
            Block::Columns(left, right) => left.iter().chain(right).all(Block::is_empty),
            Block::Group(_, blocks) | Block::Details(_, blocks) => blocks.iter().all(Block::is_empty),
        }
    }

    fn render(&self) -> Markup {
        if self.is_empty() {
            return html! {};
        }
        match self {
            Block::Text(text) => html! { p { (text) } },
            Block::Notices(list) => html! {
                div.notices role="note" { ul { @for notice in list { li { (notice) } } } }
            },
            Block::Tiles(tiles) => html! {
                dl.tiles {
                    @for tile in tiles {
                        div {
                            dt { (tile.label) }
                            dd.value { (tile.value) }
                            @if !tile.note.is_empty() { dd.note { (tile.note) } }
                        }
                    }
                }
            },
            Block::Facts(facts) => facts_list(facts),
            Block::Table(table) => table.render(),
            Block::Figure(figure) => figure.render(),
            Block::Gallery(figures) => html! {
                // Two stand side by side; more are packed by their heights.
                div class=(if figures.len() <= 2 { "pair" } else { "gallery" }) {
                    @for figure in figures { (figure.render()) }
                }
            },
            Block::Columns(left, right) => html! {
                div.columns { div { (render_all(left)) } div { (render_all(right)) } }
            },
            Block::Group(heading, blocks) => html! { section.group { h3 { (heading) } (render_all(blocks)) } },
            Block::Details(summary, blocks) => html! { details { summary { (summary) } (render_all(blocks)) } },
            Block::Command(command) => html! { pre { code { (command) } } },
        }
    }
}

fn render_all(blocks: &[Block]) -> Markup {
    html! { @for block in blocks { (block.render()) } }
}

fn facts_list(facts: &[(String, String)]) -> Markup {
    html! { dl.facts { @for (name, value) in facts { div { dt { (name) } dd { (value) } } } } }
}

impl Page {
    /// A page without content. `version` is that of the program, and of the model where there is one.
    pub fn new(title: impl Into<String>, version: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            version: version.into(),
            ..Self::default()
        }
    }

    /// With a sentence at the top: first what matters most.
    #[must_use]
    pub fn lead(mut self, sentence: impl Into<String>) -> Self {
        self.lead.push(sentence.into());
        self
    }

    /// With a line on what the page is about: `Data`, `cubespec-fsm-lowband`.
    #[must_use]
    pub fn fact(mut self, name: impl Into<String>, value: impl Into<String>) -> Self {
        self.facts.push((name.into(), value.into()));
        self
    }

    /// With one more section; one without content is left out.
    #[must_use]
    pub fn section(mut self, section: Section) -> Self {
        if !section.blocks.iter().all(Block::is_empty) {
            self.sections.push(section);
        }
        self
    }

    /// The page as HTML. The same page gives the same bytes.
    pub fn render(&self) -> String {
        html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    meta name="color-scheme" content="light dark";
                    title { (self.title) }
                    style { (PreEscaped(palette::stylesheet())) (PreEscaped(STYLE)) }
                }
                body {
                    header {
                        h1 { (self.title) }
                        @if !self.facts.is_empty() { (facts_list(&self.facts)) }
                        @for (index, sentence) in self.lead.iter().enumerate() {
                            p .lead[index == 0] { (sentence) }
                        }
                        @if self.sections.len() > 2 {
                            nav aria-label="Contents" { ul {
                                @for (index, section) in self.sections.iter().enumerate() {
                                    li { a href={"#part-" (index + 1)} { (section.heading) } }
                                }
                            } }
                        }
                    }
                    main {
                        @for (index, section) in self.sections.iter().enumerate() {
                            section id={"part-" (index + 1)} {
                                h2 { (section.heading) }
                                (render_all(&section.blocks))
                            }
                        }
                    }
                    footer { p { "Made by hysteron " (self.version) "." } }
                }
            }
        }
        .into_string()
    }
}
