//! Robot files; the program `xacro` expands macros if this is permitted.

use crate::error::{StudyFileError, XacroError};
use dynident_model::{MAX_DESCRIPTION_BYTES, Robot, load_robot_with, required_xacro_arguments};
use dynident_system::{ProgramPermission, ProgramPurpose, ProgramRequest, RunLimits, run_to_end};
use std::collections::BTreeMap;
use std::path::Path;

/// Arguments and time limit of the program `xacro`.
#[derive(Clone, Debug, PartialEq)]
pub struct XacroSettings {
    /// Arguments by name: `xacro FILE NAME:=VALUE`. For other arguments the defaults in the file are used.
    pub arguments: BTreeMap<String, String>,
    /// Time limit of the program, s. Default [`DEFAULT_LIMIT_S`](Self::DEFAULT_LIMIT_S).
    pub limit_s: f64,
}

impl XacroSettings {
    /// The default time limit, s. xacro 2.1.1 expands a UR10 in 0.06 s of processor time, in 0.8 s on a busy computer;
    /// the limit allows for large robots and a slow disk.
    pub const DEFAULT_LIMIT_S: f64 = 30.0;

    /// Checks the settings.
    ///
    /// # Errors
    /// An invalid argument name, or a time limit that is not positive.
    pub fn validate(&self) -> Result<(), XacroError> {
        if let Some((name, value)) = self.arguments.iter().find(|(name, value)| !is_name(name) || value.contains('\0'))
        {
            return Err(XacroError::Argument { name: name.clone(), value: value.clone() });
        }
        if !(self.limit_s > 0.0 && self.limit_s <= 1e6) {
            return Err(XacroError::TimeLimit { limit_s: self.limit_s });
        }
        Ok(())
    }

    fn request(&self, file: &str) -> ProgramRequest {
        // A name that starts with a dash would be read as an option.
        let file = if file.starts_with('-') { format!("./{file}") } else { file.to_owned() };
        let arguments = self.arguments.iter().map(|(name, value)| format!("{name}:={value}"));
        ProgramRequest::new(ProgramPurpose::Xacro, ["xacro".to_owned(), file].into_iter().chain(arguments))
    }
}

impl Default for XacroSettings {
    fn default() -> Self {
        Self { arguments: BTreeMap::new(), limit_s: Self::DEFAULT_LIMIT_S }
    }
}

/// Settings for reading a robot file. By default no program is started.
#[derive(Clone, Default)]
pub struct LoadSettings<'a> {
    /// Settings of the program `xacro`.
    pub xacro: XacroSettings,
    /// Whether the program `xacro` may be started.
    pub programs: ProgramPermission<'a>,
    /// Stops the program when it returns true.
    pub is_stopped: Option<&'a dyn Fn() -> bool>,
}

/// Reads a robot file like [`dynident_model::load_robot`]. The program `xacro` expands a file with xacro macros if
/// `settings` permit that. xacro evaluates Python expressions of the file, so an untrusted file can run any command.
///
/// # Errors
/// [`StudyFileError::Robot`] if the file cannot be read; [`StudyFileError::Xacro`] if it cannot be expanded, and for
/// xacro arguments for a file without macros.
pub fn load_robot(path: &Path, settings: &LoadSettings<'_>) -> Result<Robot, StudyFileError> {
    let wrong = |source: XacroError| StudyFileError::Xacro { path: path.to_owned(), source: Box::new(source) };
    settings.xacro.validate().map_err(wrong)?;
    let mut has_macros = false;
    let robot = load_robot_with::<StudyFileError>(path, |path| {
        has_macros = true;
        expanded(path, settings).map_err(wrong)
    })?;
    if has_macros || settings.xacro.arguments.is_empty() { Ok(robot) } else { Err(wrong(XacroError::NoMacros)) }
}

/// Whether a text can be the name of an argument.
fn is_name(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
        && name.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.' | '/'))
}

fn expanded(path: &Path, settings: &LoadSettings<'_>) -> Result<String, XacroError> {
    let file = path.to_str().ok_or(XacroError::Path)?;
    let request = settings.xacro.request(file);
    let by_hand = || {
        let target = ProgramRequest::new(ProgramPurpose::Xacro, [expanded_name(file)]);
        let text = dynident_files::read_text(path, MAX_DESCRIPTION_BYTES).unwrap_or_default();
        let needed = required_xacro_arguments(&text);
        let missing = needed.iter().filter(|name| is_name(name) && !settings.xacro.arguments.contains_key(*name));
        let missing = missing.fold(String::new(), |all, name| all + " " + name + ":=VALUE");
        format!("{}{missing} > {}", request.command_line(), target.command_line())
    };
    let program =
        settings.programs.permit(request.clone()).map_err(|_| XacroError::NotPermitted { by_hand: by_hand() })?;
    let limits = RunLimits { time_s: settings.xacro.limit_s, output_bytes: MAX_DESCRIPTION_BYTES };
    let bytes = run_to_end(&program, limits, settings.is_stopped.unwrap_or(&|| false))?;
    String::from_utf8(bytes).map_err(|_| XacroError::NotText)
}

/// Name of the expanded file; it differs from the name of the input.
fn expanded_name(file: &str) -> String {
    let name = Path::new(file).file_name().map_or_else(|| file.to_owned(), |name| name.to_string_lossy().into_owned());
    let name = name.strip_suffix(".xacro").unwrap_or(&name);
    let stem = name.strip_suffix(".urdf").or_else(|| name.strip_suffix(".xml")).unwrap_or(name);
    format!("{}.expanded.urdf", stem.trim_start_matches('-'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_is_one_that_can_be_typed() {
        let settings = XacroSettings {
            arguments: [("ur_type", "ur5e"), ("name", "my arm")]
                .map(|(name, value)| (name.to_owned(), value.to_owned()))
                .into(),
            ..XacroSettings::default()
        };
        assert_eq!(settings.request("-arm.xacro").command_line(), "xacro ./-arm.xacro 'name:=my arm' ur_type:=ur5e");
        for (file, expanded) in [
            ("robots/arm.urdf.xacro", "arm.expanded.urdf"),
            ("arm.urdf", "arm.expanded.urdf"),
            ("-arm.xacro", "arm.expanded.urdf"),
            ("arm", "arm.expanded.urdf"),
        ] {
            assert_eq!(expanded_name(file), expanded);
        }
    }

    #[test]
    fn the_command_names_arguments_that_are_missing() {
        let folder = std::env::temp_dir().join(format!("dynident-xacro-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("arm.urdf.xacro");
        let arguments = r#"<xacro:arg name="ur_type"/><xacro:arg name="name"/><xacro:arg name="prefix" default=""/>"#;
        std::fs::write(&path, format!(r#"<robot xmlns:xacro="x" name="r">{arguments}</robot>"#)).unwrap();
        let mut settings = LoadSettings::default();
        settings.xacro.arguments.insert("name".to_owned(), "arm".to_owned());
        let error = load_robot(&path, &settings).unwrap_err().to_string();
        std::fs::remove_dir_all(folder).unwrap();
        assert!(error.ends_with("arm.urdf.xacro name:=arm ur_type:=VALUE > arm.expanded.urdf"), "{error}");
    }

    #[test]
    fn arguments_cannot_be_options() {
        let of = |name: &str| {
            let arguments = BTreeMap::from([(name.to_owned(), "x".to_owned())]);
            XacroSettings { arguments, ..XacroSettings::default() }.validate()
        };
        assert!(of("ur_type").is_ok() && of("a.b/c-d").is_ok());
        for name in ["", "-o", "--help", "1", "a b", "a:=b", "a\n", "ä"] {
            assert!(of(name).unwrap_err().to_string().contains("argument"), "{name}");
        }
        for limit_s in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(XacroSettings { limit_s, ..XacroSettings::default() }.validate().is_err());
        }
    }
}
