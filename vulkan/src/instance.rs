//! The loader, its drivers, and the validation layers.

use crate::error::{VulkanError, failed};
use crate::messages::Messages;
use ash::{ext, khr, vk};
use std::env;
use std::ffi::CStr;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Options for starting Vulkan.
#[derive(Clone, Debug, Default)]
pub struct InstanceOptions {
    /// The loader's file; the default is the system's.
    pub loader: Option<PathBuf>,
    /// Validation and synchronization validation: the work after a message fails.
    pub validation: bool,
}

/// Vulkan itself, loaded at run time, so that everything else works on a machine without it.
pub struct Instance {
    pub(crate) entry: ash::Entry,
    pub(crate) raw: ash::Instance,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    messages: Messages,
    /// A number that is unique in this process, as handles are reused.
    pub(crate) number: u64,
}

static INSTANCES: AtomicU64 = AtomicU64::new(0);

impl Instance {
    /// Loads the loader and the drivers that it finds.
    ///
    /// # Errors
    /// [`VulkanError::NoLoader`], [`VulkanError::LoaderTooOld`], [`VulkanError::NoDevice`] without a driver,
    /// [`VulkanError::NoValidation`].
    pub fn load(options: &InstanceOptions) -> Result<Arc<Instance>, VulkanError> {
        // SAFETY: loading a library runs its initialisers; it is the system's or the person's own choice.
        let entry = unsafe {
            match &options.loader {
                Some(path) => ash::Entry::load_from(path),
                None => ash::Entry::load(),
            }
        };
        let entry = entry.map_err(|error| VulkanError::NoLoader(error.to_string()))?;
        // SAFETY: no requirements.
        let found = unsafe { entry.try_enumerate_instance_version() }.map_err(failed("vkEnumerateInstanceVersion"))?;
        // A loader of Vulkan 1.0 does not have this function.
        let found = found.unwrap_or(vk::API_VERSION_1_0);
        if found < vk::API_VERSION_1_1 {
            return Err(VulkanError::LoaderTooOld(found));
        }
        let messages = Messages::default();
        let raw = create(&entry, options, &messages)?;
        let mut instance =
            Instance { raw, messenger: None, messages, number: INSTANCES.fetch_add(1, Ordering::Relaxed), entry };
        if options.validation {
            let functions = ext::debug_utils::Instance::new(&instance.entry, &instance.raw);
            // SAFETY: the extension is enabled; the messages outlive the messenger.
            let messenger = unsafe { functions.create_debug_utils_messenger(&instance.messages.create_info(), None) }
                .map_err(failed("vkCreateDebugUtilsMessengerEXT"))?;
            instance.messenger = Some((functions, messenger));
        }
        Ok(Arc::new(instance))
    }

    /// What a device says of the features in a struct that it knows.
    pub(crate) fn features<T: vk::ExtendsPhysicalDeviceFeatures2 + Default>(&self, device: vk::PhysicalDevice) -> T {
        let mut asked = T::default();
        let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut asked);
        // SAFETY: the device is the instance's, and knows the chained struct.
        unsafe { self.raw.get_physical_device_features2(device, &mut features) };
        asked
    }

    /// The messages of the validation layers.
    pub fn messages(&self) -> &Messages {
        &self.messages
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: devices hold the instance alive: none is left.
        unsafe {
            if let Some((functions, messenger)) = &self.messenger {
                functions.destroy_debug_utils_messenger(*messenger, None);
            }
            self.raw.destroy_instance(None);
        }
    }
}

fn create(entry: &ash::Entry, options: &InstanceOptions, messages: &Messages) -> Result<ash::Instance, VulkanError> {
    let application = vk::ApplicationInfo::default().application_name(c"viewfuse").api_version(vk::API_VERSION_1_2);
    let (mut layers, mut extensions) = (Vec::new(), Vec::new());
    let mut flags = vk::InstanceCreateFlags::empty();
    // SAFETY: no requirements.
    let offered = unsafe { entry.enumerate_instance_extension_properties(None) }
        .map_err(failed("vkEnumerateInstanceExtensionProperties"))?;
    if offered.iter().any(|extension| extension.extension_name_as_c_str() == Ok(khr::portability_enumeration::NAME)) {
        // Drivers on top of another interface (MoltenVK) are listed only on request.
        extensions.push(khr::portability_enumeration::NAME.as_ptr());
        flags |= vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR;
    }
    let yes = [vk::TRUE];
    let on = |name: &'static CStr| {
        let setting = vk::LayerSettingEXT::default().layer_name(VALIDATION_LAYER).setting_name(name);
        let values = yes.as_ptr().cast();
        vk::LayerSettingEXT { ty: vk::LayerSettingTypeEXT::BOOL32, value_count: 1, p_values: values, ..setting }
    };
    let settings = [on(c"validate_sync"), on(c"syncval_shader_accesses_heuristic")];
    let mut settings = vk::LayerSettingsCreateInfoEXT::default().settings(&settings);
    let synchronization = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
    let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&synchronization);
    let mut messenger = messages.create_info();
    let mut info = vk::InstanceCreateInfo::default().application_info(&application);
    if options.validation {
        let layer_extensions = layer_extensions(entry)?;
        layers.push(VALIDATION_LAYER.as_ptr());
        extensions.push(ext::debug_utils::NAME.as_ptr());
        // Layers since 1.3.250 are set in this way, those before in that.
        if layer_extensions.iter().any(|extension| extension.extension_name_as_c_str() == Ok(ext::layer_settings::NAME))
        {
            extensions.push(ext::layer_settings::NAME.as_ptr());
            info = info.push_next(&mut settings);
        } else {
            extensions.push(ext::validation_features::NAME.as_ptr());
            info = info.push_next(&mut features);
        }
        info = info.push_next(&mut messenger);
    }
    let info = info.enabled_layer_names(&layers).enabled_extension_names(&extensions).flags(flags);
    // SAFETY: everything that `info` points to lives until the call returns.
    unsafe { entry.create_instance(&info, None) }.map_err(|result| match result {
        vk::Result::ERROR_INCOMPATIBLE_DRIVER => VulkanError::NoDevice(no_driver()),
        result => VulkanError::Call("vkCreateInstance", result),
    })
}

/// The reason why there is no driver. The loader does not report which files it rejected; these variables set its
/// search path.
fn no_driver() -> String {
    let told = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"].into_iter().find_map(|name| Some((name, env::var_os(name)?)));
    match told {
        Some((name, files)) => format!("no driver can be loaded; {name} is {}", files.display()),
        None => "no driver is installed; Debian's software driver is the package mesa-vulkan-drivers".to_owned(),
    }
}

/// The extensions of the validation layer.
fn layer_extensions(entry: &ash::Entry) -> Result<Vec<vk::ExtensionProperties>, VulkanError> {
    // SAFETY: no requirements.
    let layers =
        unsafe { entry.enumerate_instance_layer_properties() }.map_err(failed("vkEnumerateInstanceLayerProperties"))?;
    if !layers.iter().any(|layer| layer.layer_name_as_c_str() == Ok(VALIDATION_LAYER)) {
        return Err(VulkanError::NoValidation("VK_LAYER_KHRONOS_validation"));
    }
    // SAFETY: no requirements.
    unsafe { entry.enumerate_instance_extension_properties(Some(VALIDATION_LAYER)) }
        .map_err(failed("vkEnumerateInstanceExtensionProperties"))
}
