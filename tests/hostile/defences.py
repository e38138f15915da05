"""The defences of docs/explanation/security.md: the line of each, what takes it out, and the test that fails then."""

from typing import NamedTuple


class Defence(NamedTuple):
    """A line that defends something.

    Attributes:
        name: What it does.
        module: The module that has it, without `fleet2d.`.
        line: Its text, which the module has once.
        instead: The text that takes it out.
        test: The test that fails without it, below `tests`.
    """

    name: str
    module: str
    line: str
    instead: str
    test: str


CHECKPOINTS = [
    Defence(
        "a checkpoint has a signature of this user",
        "engine.snapshot",
        "if not hmac.compare_digest(seal.hexdigest().encode(), view[-SIGNATURE_CHARACTERS:]):",
        "if False:",
        "hostile/test_trust.py::test_a_forged_checkpoint_runs_no_command",
    ),
    Defence(
        "it belongs to the manifest",
        "engine.checkpoint",
        "if _fixed_part(stored) != _fixed_part(manifest, like=stored):",
        "if False:",
        "hostile/test_trust.py::test_what_is_not_as_it_was_signed_is_simulated_again",
    ),
    Defence(
        "it belongs to the journal",
        "engine.checkpoint",
        'if journal != header["journal"]:',
        "if False:",
        "hostile/test_trust.py::test_what_is_not_as_it_was_signed_is_simulated_again",
    ),
    Defence(
        "a signature is for one purpose",
        "storage.secret_files",
        'f"{purpose}\\n".encode()',
        "b''",
        "storage/test_secret_files.py::test_a_signature_is_for_one_purpose_and_one_content",
    ),
    Defence(
        "a key that others may read isn't used",
        "storage.secret_files",
        "if _IS_POSIX and found.st_mode & 0o077:",
        "if False:",
        "storage/test_secret_files.py::test_a_secret_that_others_may_know_is_refused",
    ),
    Defence(
        "a key of another user isn't used",
        "storage.secret_files",
        "if _IS_POSIX and found.st_uid != os.geteuid():",
        "if False:",
        "storage/test_secret_files.py::test_a_secret_of_another_user_is_refused",
    ),
    Defence(
        "a key that is a link isn't used",
        "storage.secret_files",
        "is_link = path.is_symlink()",
        "path = path.resolve(); is_link = False",
        "storage/test_secret_files.py::test_a_secret_that_others_may_know_is_refused",
    ),
]
CODE = [
    Defence(
        "code of a stored run is listed, and asks",
        "configuration.trust",
        "code = [] if trust else code_lines(content)",
        "code = []",
        "hostile/test_trust.py::test_no_code_of_a_stored_run_is_imported_without_trust",
    ),
    Defence(
        "no class is imported while no code may run",
        "configuration.trust",
        "for each in () if may_run_code() else code:",
        "for each in ():",
        "hostile/test_trust.py::test_no_code_of_a_stored_run_is_imported_without_trust",
    ),
    Defence(
        "no code runs that the list doesn't have",
        "configuration.trust",
        "with running_code(allowed=trust):",
        "with running_code(allowed=True):",
        "configuration/test_trust.py::test_an_interrupt_that_only_a_checkpoint_names_asks_for_trust",
    ),
    Defence(
        "programs are listed",
        "configuration.trust",
        "if program := _program_of(value):",
        "if program := '':",
        "configuration/test_trust.py::test_all_of_a_program_is_listed",
    ),
    Defence(
        "extended files are listed",
        "configuration.trust",
        "if is_extended and (file := _file(text)):",
        "if False:",
        "configuration/test_trust.py::test_a_file_that_a_stored_scenario_extends_is_listed_and_its_code_asks",
    ),
    Defence(
        "networks are listed as code",
        "configuration.trust",
        "if text.endswith(NETWORK):  # a network may run for ever, or fill the memory",
        "if False:",
        "hostile/test_networks.py::test_networks_of_behaviors_and_of_models_are_listed_as_code",
    ),
    Defence(
        "a network has the suffix by which it is listed",
        "configuration.networks",
        "if path.suffix != NETWORK:  # files that run are listed by this suffix",
        "if False:",
        "configuration/test_networks.py::test_a_network_by_another_name_is_not_read",
    ),
    Defence(
        "no network is read while no code may run",
        "configuration.networks",
        "check_may_run(str(path), [path.resolve()])",
        "pass",
        "configuration/test_networks.py::test_no_network_is_read_while_no_code_may_run",
    ),
]
FOLDERS = [
    Defence(
        "a name leads nowhere else",
        "storage.files",
        'and not {"", ".", ".."} & set(name.split("/"))',
        "",
        "storage/test_files.py::test_a_name_that_leads_elsewhere_is_refused",
    ),
    Defence(
        "a name has no escapes",
        "storage.files",
        "and name.isprintable()",
        "",
        "storage/test_files.py::test_a_name_that_leads_elsewhere_is_refused",
    ),
    Defence(
        "no link is followed",
        "storage.files",
        "if stat.S_ISLNK(mode):",
        "if False:",
        "storage/test_files.py::test_links_and_devices_are_refused_wherever_they_are_on_the_way",
    ),
    Defence(
        "no pipe in a folder is waited for",
        "storage.files",
        "if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):",
        "if False:",
        "storage/test_files.py::test_links_and_devices_are_refused_wherever_they_are_on_the_way",
    ),
    Defence(
        "a run with links in it isn't continued",
        "engine.repeat",
        "refuse_links(root, (FOLDER, LEARNED_NAME))",
        "pass",
        "engine/test_repeat_resume.py::test_a_run_with_a_link_in_it_is_not_gone_on_with",
    ),
    Defence(
        "a data set with links in it isn't completed",
        "learning.datasets.generate",
        "refuse_links(root, (PARTS, PICTURES, *plan.file.splits))",
        "pass",
        "hostile/test_datasets.py::test_files_that_are_lacking_are_not_made_through_a_link",
    ),
    Defence(
        "the folder of a bag has no links",
        "storage.bags",
        "refuse_links(path)",
        "pass",
        "hostile/test_archives.py::test_a_link_or_a_pipe_in_a_bag_is_refused",
    ),
    Defence(
        "files that are no part of a run are listed",
        "artifacts.verification",
        "return sorted(map(printable, names - own))",
        "return []",
        "hostile/test_forged_runs.py::test_all_that_is_not_part_of_the_run_is_listed",
    ),
]
INPUTS = [
    Defence(
        "an input is no pipe",
        "inputs",
        "if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):",
        "if False:",
        "test_inputs.py::test_pipes_sockets_devices_and_folders_are_refused",
    ),
    Defence(
        "it is none when it is opened",
        "inputs",
        "if stat.S_ISREG(os.fstat(file.fileno()).st_mode):",
        "if True:",
        "test_inputs.py::test_a_pipe_in_place_of_a_checked_file_is_refused",
    ),
    Defence(
        "it is no link when it is opened",
        "inputs",
        '| getattr(os, "O_NOFOLLOW", 0)',
        "",
        "test_inputs.py::test_a_link_in_place_of_a_checked_file_is_not_followed",
    ),
    Defence(
        "it is within the root",
        "inputs",
        "if root is None or real.is_relative_to(root) or real.is_relative_to(PACKAGE):",
        "if True:",
        "test_inputs.py::test_paths_out_of_a_root_are_refused",
    ),
    Defence(
        "links are followed before",
        "inputs",
        "real = Path(os.path.realpath(path))",
        "real = Path(os.path.abspath(path))",
        "test_inputs.py::test_paths_out_of_a_root_are_refused",
    ),
]
STORED = [
    Defence(
        "a manifest has only known fields of the right types",
        "artifacts.manifest",
        'model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)',
        "model_config = ConfigDict()",
        "artifacts/test_seal.py::test_an_edited_manifest_is_refused_with_the_field",
    ),
    Defence(
        "it has no key twice",
        "artifacts.manifest",
        "object_pairs_hook=unique_keys,",
        "",
        "artifacts/test_seal.py::test_a_strange_text_is_refused",
    ),
    Defence(
        "it has no NaN",
        "artifacts.manifest",
        "parse_constant=_refuse_constant,",
        "",
        "artifacts/test_seal.py::test_a_strange_text_is_refused",
    ),
    Defence(
        "tables are as the manifest says",
        "artifacts.verification",
        "return record == stored",
        "return True",
        "hostile/test_forged_runs.py::test_a_rewritten_table_under_a_new_seal_is_noticed",
    ),
    Defence(
        "files are as they were sealed",
        "artifacts.verification",
        'return "" if file_record(path) == record else "was changed"',
        'return ""',
        "artifacts/test_seal.py::test_any_change_of_bytes_is_noticed_and_its_file_named",
    ),
    Defence(
        "the manifest is as it was sealed",
        "artifacts.verification",
        "elif fields[name] != seal.fields[name]:",
        "elif False:",
        "artifacts/test_seal.py::test_a_changed_field_is_named",
    ),
    Defence(
        "tables of a data set have its columns",
        "learning.datasets.reader",
        "problem = _problem(content, SCHEMAS[table])",
        'problem = ""',
        "learning/datasets/test_reader.py::test_a_value_that_no_data_set_has_is_refused",
    ),
    Defence(
        "frames of a journal have a checksum",
        "storage.files",
        "if _checksum(number, text, content) != checksum:",
        "if False:",
        "storage/test_files_journal.py::test_a_changed_byte_ends_the_journal_before_its_frame",
    ),
    Defence(
        "the sizes in a journal fit the file",
        "storage.files",
        "if number >= len(kinds) or end > size:",
        "if number >= len(kinds):",
        "storage/test_files_journal.py::test_a_size_beyond_the_file_is_not_read",
    ),
]
BOUNDS = [
    Defence(
        "bounds refuse what is beyond them",
        "bounds",
        "if amount > self.limit:",
        "if False:",
        "test_bounds_of_input.py::test_a_bound_is_raised_by_the_environment",
    ),
    Defence(
        "files have a size",
        "bounds",
        "bound.check(input_path(path, error).stat().st_size, path, error)",
        "input_path(path, error)",
        "test_bounds_of_input.py::test_a_large_file_is_refused_before_it_is_read",
    ),
    Defence(
        "so have files that grow",
        "bounds",
        "bound.check(len(content), path, error)  # the file may have grown in the meantime",
        "pass",
        "test_bounds_of_input.py::test_a_file_that_has_grown_is_refused",
    ),
    Defence(
        "YAML has a depth",
        "configuration.documents",
        "if len(self._parents) >= self._most_depth:",
        "if False:",
        "test_bounds_of_input.py::test_a_bound_is_raised_by_the_environment",
    ),
    Defence(
        "aliases of YAML count again",
        "configuration.documents",
        "if self._values > self._most_values:",
        "if False:",
        "configuration/test_documents.py::test_values_of_an_anchor_count_for_each_alias",
    ),
    Defence(
        "long texts of YAML are counted before their nodes are built",
        "configuration.documents",
        "_check_events(text, _FastLoader)",
        "pass",
        "configuration/test_documents.py::test_a_long_text_is_counted_before_its_nodes_are_built",
    ),
    Defence(
        "arrays have a size unpacked",
        "storage.archives",
        "bound.check(sum(member.file_size for member in members), path)",
        "pass",
        "hostile/test_archives.py::test_an_archive_that_unpacks_to_more_than_the_bound_is_refused",
    ),
    Defence(
        "arrays are packed as NumPy does it",
        "storage.archives",
        "if member.compress_type not in (ZIP_STORED, ZIP_DEFLATED):",
        "if False:",
        "storage/test_archives.py::test_another_compression_is_refused_before_it_is_unpacked",
    ),
    Defence(
        "an archive has few arrays",
        "storage.archives",
        'if struct.unpack_from("<I", content, end + _LIST_SIZE_AT)[0] > _LIST_BYTES:',
        "if False:",
        "hostile/test_archives.py::test_an_archive_with_a_hundred_thousand_arrays_is_refused",
    ),
    Defence(
        "no array has a name twice",
        "storage.archives",
        "if name in arrays:",
        "if False:",
        "hostile/test_archives.py::test_an_array_that_is_there_twice_is_refused",
    ),
    Defence(
        "tables have a size unpacked",
        "bounds",
        "return max(stated, sum(int(row_group.num_rows) for row_group in metadata) * row_bytes)",
        "return stated",
        "test_bounds_of_input.py::test_a_file_that_unfolds_to_gigabytes_is_refused[table.parquet]",
    ),
]
CHILD = [
    Defence(
        "the child has limited processor time",
        "storage.apart",
        "resource.RLIMIT_CPU: math.ceil(time.process_time() + seconds),",
        "",
        "storage/test_apart.py::test_processor_time_ends_before_the_clock_does",
    ),
    Defence(
        "it has limited time by the clock",
        "storage.apart",
        "timer = Timer(patience, process.kill)",
        "timer = Timer(patience, int)",
        "storage/test_apart.py::test_clock_limits_what_takes_no_processor_time",
    ),
    Defence(
        "it has limited memory",
        "storage.apart",
        "limits[resource.RLIMIT_AS] = base + (READ_MB.limit << 20)",
        "pass",
        "storage/test_apart.py::test_memory_is_limited",
    ),
    Defence(
        "files that it writes have a size",
        "storage.apart",
        "resource.RLIMIT_FSIZE: LOG_BYTES.limit,",
        "",
        "hostile/test_archives.py::test_file_that_unpacks_to_more_than_a_log_has_is_refused",
    ),
    Defence(
        "its answers have types",
        "storage.apart",
        'return _checked(content["value"], kind)',
        'return content["value"]',
        "storage/test_apart.py::test_wrong_answer_is_refused",
    ),
    Defence(
        "their coordinates are finite",
        "storage.apart",
        "if not all(np.isfinite(ring).all() for ring in corners):",
        "if False:",
        "storage/test_apart.py::test_coordinate_beyond_all_floats_is_refused",
    ),
    Defence(
        "they have a number of values",
        "storage.apart",
        'if answer.count(b",") > JSON_VALUES.limit:',
        "if False:",
        "storage/test_apart.py::test_answer_of_too_many_values_is_not_parsed",
    ),
    Defence(
        "they have a size",
        "storage.apart",
        'min(int.from_bytes(process.stdout.read(8), "big"), READ_MB.limit << 20)',
        'int.from_bytes(process.stdout.read(8), "big")',
        "storage/test_apart.py::test_wrong_answer_is_an_error_of_one_line",
    ),
]
ASSISTANT = [
    Defence(
        "an assistant is kept in its folder",
        "live.mcp_server",
        "with place.lock, within(place.folder), running_code(allowed=False):",
        "with place.lock, running_code(allowed=False):",
        "live/test_mcp_server.py::test_nothing_outside_is_quoted_in_a_message",
    ),
    Defence(
        "its scenarios run no code",
        "live.mcp_server",
        "with place.lock, within(place.folder), running_code(allowed=False):",
        "with place.lock, within(place.folder):",
        "live/test_mcp_server.py::test_files_outside_and_code_are_refused",
    ),
    Defence(
        "its names stay in the folder",
        "live.mcp_server",
        "if not path.is_relative_to(self.folder) or path == self.folder:",
        "if False:",
        "live/test_mcp_server.py::test_paths_out_of_the_folder_are_refused",
    ),
    Defence(
        "a query has listed functions only",
        "live.questions",
        'check_known(node["function_name"], "function", FUNCTIONS, InputError)',
        "pass",
        "live/test_questions.py::test_a_query_reads_and_changes_nothing_else",
    ),
    Defence(
        "a query is one SELECT",
        "live.questions",
        'if len(tree["statements"]) != 1:',
        "if False:",
        "live/test_questions.py::test_what_is_not_there_is_an_error",
    ),
    Defence(
        "it reads the tables of the run only",
        "live.questions",
        'check_known(name.lower(), "table", known, InputError)',
        "pass",
        "live/test_questions.py::test_a_query_reads_and_changes_nothing_else",
    ),
    Defence(
        "DuckDB opens no files, and finds no variables of Python",
        "live.questions",
        '"enable_external_access": "false",',
        "",
        "live/test_questions.py::test_the_database_itself_is_closed",
    ),
    Defence(
        "the settings of DuckDB are locked",
        "live.questions",
        '"lock_configuration": "true",',
        "",
        "live/test_questions.py::test_the_database_itself_is_closed",
    ),
    Defence(
        "a query has limited memory",
        "live.questions",
        '"memory_limit": "1GB",',
        '"memory_limit": "100GB",',
        "live/test_questions.py::test_the_database_itself_is_closed",
    ),
]
TERMINAL = [
    Defence(
        "messages have no escapes",
        "errors",
        '_cut(printable(a, "\\n\\t"))',
        "_cut(a)",
        "test_errors.py::test_control_characters_of_a_message_are_escaped",
    ),
    Defence(
        "the list of code has no escapes",
        "configuration.trust",
        "lines.append(printable(f\"  {code} ({', '.join(keys[:_MAX_KEYS])}{more})\"))",
        "lines.append(f\"  {code} ({', '.join(keys[:_MAX_KEYS])}{more})\")",
        "configuration/test_trust.py::test_all_of_a_program_is_listed",
    ),
    Defence(
        "its title has no escapes",
        "configuration.trust",
        "{printable(str(title))}",
        "{title}",
        "configuration/test_trust.py::test_the_name_of_a_stored_run_is_escaped",
    ),
    Defence(
        "names of foreign files have no escapes",
        "artifacts.verification",
        "return sorted(map(printable, names - own))",
        "return sorted(names - own)",
        "hostile/test_forged_runs.py::test_names_of_foreign_files_reach_no_terminal_unescaped",
    ),
]
PAGE = [
    Defence(
        "the page answers under its own name",
        "viewing.page_server",
        'if headers.get("host", "") not in self._hosts:',
        "if False:",
        "viewing/test_page_server.py::test_other_name_for_this_machine_is_refused",
    ),
    Defence(
        "it answers its own pages",
        "viewing.page_server",
        "if origin is not None and origin not in self._origins:",
        "if False:",
        "viewing/test_page_server.py::test_other_page_is_refused_even_with_the_token",
    ),
    Defence(
        "it answers what the browser says is of its own",
        "viewing.page_server",
        'if headers.get("sec-fetch-site", "none") not in ("same-origin", "none"):',
        "if False:",
        "viewing/test_page_server.py::test_request_that_a_browser_marks_as_of_another_site_is_refused",
    ),
    Defence(
        "a change says which page it comes from",
        "viewing.page_server",
        "if is_change and origin is None:",
        "if False:",
        "viewing/test_page_server.py::test_change_that_names_no_origin_is_refused",
    ),
    Defence(
        "an address has the token",
        "viewing.page_server",
        "if not secrets.compare_digest(token.encode(), self._token.encode()):",
        "if False:",
        "viewing/test_page_server.py::test_address_without_the_token_is_refused",
    ),
    Defence(
        "it serves the machine itself only",
        "viewing.page_server",
        'HOST = "127.0.0.1"',
        'HOST = "0.0.0.0"',
        "viewing/test_page_server.py::test_server_listens_on_the_loopback_only",
    ),
]
WRITING = [
    Defence(
        "a file is whole or not there",
        "storage.files",
        'partial = path.with_name(f"{path.name}{PARTIAL}")',
        "partial = path",
        "storage/test_files.py::test_a_file_that_was_not_finished_leaves_the_old_one",
    ),
    Defence(
        "it is on the disk before it replaces another",
        "storage.files",
        "            sync(handle)\n        finally:\n            os.close(handle)\n\n\n@contextmanager\ndef partial_file",
        "            pass\n        finally:\n            os.close(handle)\n\n\n@contextmanager\ndef partial_file",
        "storage/test_files.py::test_a_file_is_on_the_disk_before_it_replaces_another",
    ),
    Defence(
        "a folder is whole or not there",
        "storage.files",
        "made = beside / path.name",
        "made = path",
        "storage/test_files.py::test_a_folder_that_could_not_be_made_leaves_nothing",
    ),
    Defence(
        "a folder has one writer",
        "storage.files",
        "fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)",
        "pass",
        "storage/test_files.py::test_only_one_of_many_takes_the_lock",
    ),
]
DEFENCES = [
    *CHECKPOINTS, *CODE, *FOLDERS, *INPUTS, *STORED, *BOUNDS, *CHILD, *ASSISTANT, *TERMINAL, *PAGE,
    *WRITING,
]  # fmt: skip
