//! Messages of the validation layers.

use ash::vk;
use std::ffi::{CStr, c_void};
use std::sync::{Arc, Mutex, PoisonError};

/// Messages of the validation layers, shared, so that they can be read after the instance is dropped.
#[derive(Clone, Debug, Default)]
pub struct Messages(Arc<Mutex<Vec<String>>>);

impl Messages {
    /// All messages so far, oldest first.
    pub fn all(&self) -> Vec<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The oldest message.
    pub fn first(&self) -> Option<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).first().cloned()
    }

    /// The parameters of a messenger: warnings and errors of validation. The messages must outlive it.
    pub(crate) fn create_info(&self) -> vk::DebugUtilsMessengerCreateInfoEXT<'_> {
        vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(
                vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
            )
            .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
            .pfn_user_callback(Some(receive))
            .user_data(Arc::as_ptr(&self.0).cast_mut().cast())
    }
}

/// Called by the layers, from any thread.
///
/// # Safety
/// `user_data` is the list that [`Messages::create_info`] gave, which outlives the messenger.
unsafe extern "system" fn receive(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user_data: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layers pass valid data or none; `user_data` as above.
    let (list, data) = unsafe { (user_data.cast::<Mutex<Vec<String>>>().as_ref(), data.as_ref()) };
    if let (Some(list), Some(data)) = (list, data) {
        let text = match data.p_message.is_null() {
            true => "a message without text".to_owned(),
            // SAFETY: Vulkan's strings end in zero.
            false => unsafe { CStr::from_ptr(data.p_message) }.to_string_lossy().into_owned(),
        };
        push(list, text);
    }
    vk::FALSE
}

fn push(list: &Mutex<Vec<String>>, message: String) {
    list.lock().unwrap_or_else(PoisonError::into_inner).push(message);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_kept_in_order() {
        let messages = Messages::default();
        assert_eq!(messages.first(), None);
        push(&messages.0, "one".to_owned());
        push(&messages.clone().0, "two".to_owned());
        assert_eq!(messages.all(), ["one", "two"]);
        assert_eq!(messages.first().as_deref(), Some("one"));
    }
}
