"""The diagnosis of recordings: what is wrong with them, how that shows, and what to do."""

from contact_curation.pipeline.diagnosis.diagnosis import FEWEST_MESSAGES as FEWEST_MESSAGES
from contact_curation.pipeline.diagnosis.diagnosis import MOST_MESSAGES as MOST_MESSAGES
from contact_curation.pipeline.diagnosis.diagnosis import Diagnosis as Diagnosis
from contact_curation.pipeline.diagnosis.diagnosis import diagnose as diagnose
