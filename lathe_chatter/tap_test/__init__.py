"""From a tap test to a machine: frequency responses read, and the modes that they show."""

from __future__ import annotations

from lathe_chatter.errors import FrequencyResponseError, ModalFitError
from lathe_chatter.tap_test.measured_response import FrequencyResponse, read_frequency_responses
from lathe_chatter.tap_test.modal_fit import FittedMode, ModalFit, fit_modes

__all__ = [
    'FittedMode',
    'FrequencyResponse',
    'FrequencyResponseError',
    'ModalFit',
    'ModalFitError',
    'fit_modes',
    'read_frequency_responses',
]
