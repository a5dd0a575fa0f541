//! Figures for print as PDF and PNG, in a font that is part of the program.

use crate::error::ReportError;
use crate::print_figure::{PrintFigure, PrintStyle};

impl PrintFigure {
    /// Renders the figure as PDF of one page in its size. Text remains text, and its font is in the file.
    ///
    /// # Errors
    /// As [`PrintFigure::svg`]; [`ReportError::Characters`]; [`ReportError::NotBuilt`] without the feature `pdf`.
    pub fn pdf(&self, style: &PrintStyle) -> Result<Vec<u8>, ReportError> {
        pdf(&self.svg(style)?)
    }

    /// Renders the figure as PNG with the resolution of the style, which the file states.
    ///
    /// # Errors
    /// Same as for [`PrintFigure::svg`]; [`ReportError::Resolution`]; [`ReportError::Pixels`];
    /// [`ReportError::Characters`]; [`ReportError::NotBuilt`] without the feature `png`.
    pub fn png(&self, style: &PrintStyle) -> Result<Vec<u8>, ReportError> {
        png(&self.svg(style)?, style.dpi)
    }
}

#[cfg(not(feature = "pdf"))]
fn pdf(_: &str) -> Result<Vec<u8>, ReportError> {
    Err(ReportError::NotBuilt { form: "PDF" })
}

#[cfg(feature = "pdf")]
fn pdf(svg: &str) -> Result<Vec<u8>, ReportError> {
    /// Typographic points per inch, the unit of PDF.
    const POINTS_PER_INCH: f32 = 72.0;
    let tree = conversion::parsed(svg, "PDF", POINTS_PER_INCH)?;
    svg2pdf::to_pdf(&tree, svg2pdf::ConversionOptions::default(), svg2pdf::PageOptions { dpi: POINTS_PER_INCH })
        .map_err(|error| conversion::failed("PDF", &error))
}

#[cfg(not(feature = "png"))]
fn png(_: &str, _: f64) -> Result<Vec<u8>, ReportError> {
    Err(ReportError::NotBuilt { form: "PNG" })
}

#[cfg(feature = "png")]
fn png(svg: &str, dpi: f64) -> Result<Vec<u8>, ReportError> {
    use resvg::tiny_skia::{Color, Pixmap, Transform};

    /// The picture needs four bytes of memory for each pixel.
    const MAX_PIXELS: f64 = 50e6;
    const RESOLUTIONS_DPI: core::ops::RangeInclusive<f64> = 30.0..=2400.0;
    const METRES_PER_INCH: f64 = 0.0254;
    if !RESOLUTIONS_DPI.contains(&dpi) {
        return Err(ReportError::Resolution { dpi });
    }
    let tree = conversion::parsed(svg, "PNG", dpi as f32)?;
    let [width, height] = [tree.size().width(), tree.size().height()].map(|length| f64::from(length).round().max(1.0));
    let pixels = if width * height > MAX_PIXELS { None } else { Pixmap::new(width as u32, height as u32) };
    let mut pixels = pixels.ok_or(ReportError::Pixels { width_px: width, height_px: height })?;
    // The background of the figure covers the pixels at the edge only in part.
    pixels.fill(Color::WHITE);
    resvg::render(&tree, Transform::identity(), &mut pixels.as_mut());
    // All pixels are opaque: the alpha channel is left out.
    let colours: Vec<u8> = pixels.data().chunks_exact(4).flat_map(|pixel| &pixel[..3]).copied().collect();
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
    encoder.set_color(png::ColorType::Rgb);
    let per_metre = (dpi / METRES_PER_INCH).round() as u32;
    encoder.set_pixel_dims(Some(png::PixelDimensions { xppu: per_metre, yppu: per_metre, unit: png::Unit::Meter }));
    encoder
        .write_header()
        .and_then(|mut writer| writer.write_image_data(&colours))
        .map_err(|error| conversion::failed("PNG", &error))?;
    Ok(bytes)
}

#[cfg(any(feature = "pdf", feature = "png"))]
mod conversion {
    use crate::error::ReportError;
    use std::collections::BTreeSet;
    use usvg::{FontResolver, Group, Node, Options, Tree};

    /// DejaVu Sans Condensed, about as wide as Helvetica, for which the figures are laid out.
    const FONT: &[u8] = include_bytes!("../vendor/dejavu/DejaVuSansCondensed.ttf");

    pub(super) fn failed(form: &'static str, error: &dyn core::fmt::Display) -> ReportError {
        ReportError::Conversion { form, message: error.to_string() }
    }

    /// The picture, with lengths in units of an inch by `dpi`, and text in the embedded font only.
    pub(super) fn parsed(svg: &str, form: &'static str, dpi: f32) -> Result<Tree, ReportError> {
        let font_resolver = FontResolver {
            select_font: Box::new(|_, fonts| fonts.faces().next().map(|face| face.id)),
            select_fallback: Box::new(|_, _, _| None),
        };
        let mut options = Options { dpi, font_resolver, ..Options::default() };
        options.fontdb_mut().load_font_data(FONT.to_vec());
        let tree = Tree::from_str(svg, &options).map_err(|error| failed(form, &error))?;
        let mut missing = BTreeSet::new();
        without_glyph(tree.root(), &mut missing);
        if missing.is_empty() {
            return Ok(tree);
        }
        Err(ReportError::Characters { characters: missing.into_iter().collect::<Vec<_>>().concat() })
    }

    /// Collects the characters that are not in the font.
    fn without_glyph(group: &Group, missing: &mut BTreeSet<String>) {
        for node in group.children() {
            match node {
                Node::Group(group) => without_glyph(group, missing),
                Node::Text(text) => {
                    let glyphs = text.layouted().iter().flat_map(|span| &span.positioned_glyphs);
                    missing.extend(glyphs.filter(|glyph| glyph.id.0 == 0).map(|glyph| glyph.text.clone()));
                }
                Node::Path(_) | Node::Image(_) => {}
            }
        }
    }
}

#[cfg(all(test, feature = "pdf", feature = "png"))]
mod tests {
    use crate::{LinePlot, PrintFigure, PrintPanel, PrintStyle};

    fn figure(name: &str) -> PrintFigure {
        let plot = LinePlot::new(name, "t, s", "τ, Nm", vec![0.0, 1.0]).line("x", vec![1.0, 2.0]);
        PrintFigure { title: String::new(), panels: vec![PrintPanel::Lines(plot)] }
    }

    #[test]
    fn a_png_has_its_size_and_its_resolution() {
        for (width_mm, dpi) in [(88.0, 300.0), (180.0, 100.0)] {
            let style = PrintStyle { width_mm, dpi, ..PrintStyle::default() };
            let bytes = figure("elbow").png(&style).unwrap();
            let mut reader = png::Decoder::new(&bytes[..]).read_info().unwrap();
            let mut pixels = vec![0; reader.output_buffer_size()];
            let frame = reader.next_frame(&mut pixels).unwrap();
            assert_eq!(f64::from(frame.width), (width_mm / 25.4 * dpi).round());
            assert_eq!(f64::from(reader.info().pixel_dims.unwrap().xppu), (dpi / 0.0254).round());
            // The ground is white; text and curve are dark.
            let dark = pixels.chunks_exact(3).filter(|pixel| pixel.iter().all(|part| *part < 100)).count();
            let share = dark as f64 / f64::from(frame.width * frame.height);
            assert!(pixels[..3] == [255; 3] && share > 0.003 && share < 0.2, "{share}");
        }
    }

    #[test]
    fn a_pdf_has_a_font_and_a_page_of_the_size() {
        let text = String::from_utf8_lossy(&figure("elbow").pdf(&PrintStyle::default()).unwrap()).into_owned();
        assert!(text.starts_with("%PDF-") && text.contains("/FontFile2") && text.contains("/ToUnicode"), "{text}");
        let (_, page) = text.split_once("/MediaBox [").unwrap();
        let sides: Vec<f64> = page.split(']').next().unwrap().split(' ').map(|side| side.parse().unwrap()).collect();
        assert!((sides[2] - 88.0 / 25.4 * 72.0).abs() < 0.01, "{sides:?}");
    }

    #[test]
    fn invalid_resolutions_and_unknown_characters_are_refused() {
        for dpi in [0.0, f64::NAN, 29.0, 1e9] {
            let error = figure("elbow").png(&PrintStyle { dpi, ..PrintStyle::default() }).unwrap_err().to_string();
            assert!(error.contains("30 to 2400 dpi"), "{error}");
        }
        let large = PrintStyle { width_mm: 2000.0, dpi: 2400.0, ..PrintStyle::default() };
        assert!(figure("elbow").png(&large).unwrap_err().to_string().contains("50 million"));
        let error = figure("肘 q̈ ± ½").pdf(&PrintStyle::default()).unwrap_err().to_string();
        assert!(error.contains("\"肘\"") && error.contains(".svg"), "{error}");
    }
}
