//! One effect with its pictures.

use std::fs;
use std::path::Path;

use gyre_simulator::Effects;

use crate::picture::{Frame, Picture};
use crate::shot::Shot;

/// One effect with its pictures.
pub struct Exhibit {
    /// Heading; pictures are named after it.
    pub title: &'static str,
    /// The key of its switch, if it has one.
    pub key: Option<&'static str>,
    /// A sentence that describes the pictures.
    pub description: &'static str,
    /// The source: literature or data.
    pub source: &'static str,
    /// Captions and pictures.
    pub pictures: Vec<(&'static str, Picture)>,
}

impl Exhibit {
    /// Pictures of an effect off and on.
    pub fn switched(
        (title, key): (&'static str, &'static str),
        shot: &Shot,
        frame: &Frame,
        switch: fn(&mut Effects) -> &mut bool,
    ) -> Self {
        let picture = |on| {
            let mut shot = shot.clone();
            *switch(&mut shot.effects) = on;
            frame.picture(&[shot.scan()])
        };
        Self::of(title, vec![("off", picture(false)), ("on", picture(true))]).switch(key)
    }

    /// An exhibit of any pictures.
    pub fn of(title: &'static str, pictures: Vec<(&'static str, Picture)>) -> Self {
        Self {
            title,
            key: None,
            description: "",
            source: "",
            pictures,
        }
    }

    /// Sets the key of its switch.
    pub fn switch(self, key: &'static str) -> Self {
        Self {
            key: Some(key),
            ..self
        }
    }

    /// Sets description and source.
    pub fn words(self, description: &'static str, source: &'static str) -> Self {
        Self {
            description,
            source,
            ..self
        }
    }

    fn file(&self, caption: &str) -> String {
        let name = format!("{} {caption}", self.title).to_lowercase();
        let words = name
            .split(|c: char| !c.is_ascii_alphanumeric())
            .filter(|word| !word.is_empty());
        words.collect::<Vec<_>>().join("-") + ".png"
    }

    /// Returns its part of the page.
    pub fn markdown(&self) -> String {
        let key = self
            .key
            .map_or(String::new(), |key| format!(" (`effects.{key}`)"));
        let row = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
        let captions = row(self
            .pictures
            .iter()
            .map(|(caption, _)| (*caption).to_owned())
            .collect());
        let rule = row(vec!["---".to_owned(); self.pictures.len()]);
        let image = |caption: &str| format!("![{}, {caption}]({})", self.title, self.file(caption));
        let images = row(self
            .pictures
            .iter()
            .map(|(caption, _)| image(caption))
            .collect());
        format!(
            "\n### {}{key}\n\n{}\n\nSource: {}.\n\n{captions}{rule}{images}",
            self.title, self.description, self.source
        )
    }

    /// Writes its pictures and returns their size in bytes.
    pub fn write(&self, folder: &Path) -> Result<usize, Box<dyn std::error::Error>> {
        let mut bytes = 0;
        for (caption, picture) in &self.pictures {
            let png = picture.png()?;
            bytes += png.len();
            fs::write(folder.join(self.file(caption)), png)?;
        }
        Ok(bytes)
    }
}
